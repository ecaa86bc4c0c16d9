//! Names of tensors, without the prefixes of wrapping modules.
//!
//! Training scripts save `{'state_dict': …, 'epoch': …}`, `DataParallel` prefixes `module`,
//! `torch.compile` `_orig_mod`, and a whole module that is saved keeps its tensors under `_modules`
//! and `_parameters`.

use super::Tensor;

/// Parts of names that come from wrapping a module.
const WRAPPERS: [&str; 5] = ["module", "_orig_mod", "_modules", "_parameters", "_buffers"];

/// `path` and `name` joined by a dot.
pub(super) fn joined(path: &str, name: Option<&str>) -> String {
    match name {
        None => path.to_owned(),
        Some(name) if path.is_empty() => name.to_owned(),
        Some(name) => format!("{path}.{name}"),
    }
}

/// A name without parts that come from wrapping.
pub(super) fn canonical(name: &str) -> String {
    let parts = || name.split('.').filter(|part| !WRAPPERS.contains(part));
    if parts().next().is_none() { name.to_owned() } else { parts().collect::<Vec<_>>().join(".") }
}

/// The tensors at the same level as one named `known`, with the common prefix (such as
/// `state_dict.`) removed. Of several levels, the one with the shortest prefix is used, then the
/// first. Without such a tensor all are unchanged.
pub fn siblings_of<'a>(
    tensors: Vec<(String, Tensor<'a>)>,
    known: &[&str],
) -> Vec<(String, Tensor<'a>)> {
    let prefix_of = |name: &str| {
        let prefix = known.iter().find_map(|known| name.strip_suffix(known))?;
        (prefix.is_empty() || prefix.ends_with('.')).then_some(prefix.len())
    };
    let found = tensors
        .iter()
        .filter_map(|(name, _)| prefix_of(name).map(|length| &name[..length]))
        .min_by_key(|prefix| prefix.len())
        .map(str::to_owned);
    let Some(prefix) = found.filter(|prefix| !prefix.is_empty()) else { return tensors };
    let inside = |(name, tensor): (String, Tensor<'a>)| {
        name.strip_prefix(&prefix).map(|name| (name.to_owned(), tensor))
    };
    tensors.into_iter().filter_map(inside).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pth::Dtype;

    #[test]
    fn wrapping_prefixes_are_removed() {
        assert_eq!(canonical("module.net._orig_mod.0.weight"), "net.0.weight", "wrapped twice");
        assert_eq!(canonical("_modules.net._parameters.weight"), "net.weight", "a whole module");
        assert_eq!(canonical("module"), "module", "a name of its own");
        assert_eq!(canonical("modules.weight"), "modules.weight", "another word");
    }

    #[test]
    fn tensors_are_found_in_any_wrapper() {
        let find = |names: &[&str], known: &[&str]| -> Vec<String> {
            let tensor = || Tensor::new(Dtype::U8, &[0], 0, vec![1], vec![1]).unwrap();
            let tensors = names.iter().map(|name| ((*name).to_owned(), tensor())).collect();
            siblings_of(tensors, known).into_iter().map(|(name, _)| name).collect()
        };
        let names = ["ema.deep.net.a", "model.net.a", "model.net.b", "other.net.b", "epoch"];
        assert_eq!(find(&names, &["net.a"]), ["net.a", "net.b"], "the shorter name");
        assert_eq!(find(&["net.a", "x.net.a"], &["net.a"]), ["net.a", "x.net.a"], "not wrapped");
        assert_eq!(find(&["planet.a"], &["net.a"]), ["planet.a"], "whole parts only");
    }
}
