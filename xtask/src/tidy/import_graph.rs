//! Imports between the files of one crate, and the cycles among them.
//!
//! A file imports another if it declares it (`mod`) or names an item defined in it: in a `use`, in
//! a path that begins with `crate`, `self` or `super`, or in a macro. A re-exported name
//! (`pub use`) belongs to the file that defines it. Test modules do not count.

use anyhow::{Context, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use syn::visit::{self, Visit};

/// Path of a module within its crate; empty for the root.
type Module = Vec<String>;

/// Declarations and names found in one file.
#[derive(Debug, Default)]
struct FileFacts {
    /// File, relative to `src`.
    file: PathBuf,
    /// Modules that the file declares.
    children: Vec<String>,
    /// Names imported by `use`, and their paths.
    imports: BTreeMap<String, Vec<String>>,
    /// Every path in the file, from the crate root.
    paths: Vec<Vec<String>>,
}

/// Imports between the files of a crate, by file name relative to `src`.
#[derive(Debug, Default)]
pub(super) struct ImportGraph {
    arrows: BTreeMap<PathBuf, BTreeSet<PathBuf>>,
}

impl ImportGraph {
    /// Reads the crate whose root file (`lib.rs` or `main.rs`) is `root`.
    pub(super) fn read(root: &Path) -> Result<Self> {
        let mut modules = BTreeMap::new();
        let folder = root.parent().context("a source file has a folder")?;
        read_module(root, folder, folder, Vec::new(), &mut modules)?;
        let mut arrows: BTreeMap<PathBuf, BTreeSet<PathBuf>> = BTreeMap::new();
        for (module, facts) in &modules {
            let targets = arrows.entry(facts.file.clone()).or_default();
            for child in &facts.children {
                let mut path = module.clone();
                path.push(child.clone());
                targets.extend(modules.get(&path).map(|facts| facts.file.clone()));
            }
            for path in &facts.paths {
                targets.extend(definer(&modules, path, 0).map(|facts| facts.file.clone()));
            }
            targets.remove(&facts.file);
        }
        Ok(Self { arrows })
    }

    /// Groups of files that import each other, in order.
    pub(super) fn cycles(&self) -> Vec<Vec<PathBuf>> {
        let reached: BTreeMap<&PathBuf, BTreeSet<&PathBuf>> =
            self.arrows.keys().map(|file| (file, self.reach(file))).collect();
        let mut cycles: Vec<Vec<PathBuf>> = Vec::new();
        for (file, beyond) in &reached {
            if !beyond.contains(file) || cycles.iter().any(|cycle| cycle.contains(file)) {
                continue;
            }
            let back = |to: &&&PathBuf| reached[**to].contains(file);
            cycles.push(beyond.iter().filter(back).map(|to| (*to).clone()).collect());
        }
        cycles
    }

    /// Files that can be reached from `from` through one or more imports.
    fn reach(&self, from: &PathBuf) -> BTreeSet<&PathBuf> {
        let mut reached = BTreeSet::new();
        let mut open: Vec<&PathBuf> = self.arrows[from].iter().collect();
        while let Some(file) = open.pop() {
            if reached.insert(file) {
                open.extend(self.arrows.get(file).into_iter().flatten());
            }
        }
        reached
    }

    /// The imports inside `cycle`, one per line.
    pub(super) fn describe(&self, cycle: &[PathBuf]) -> String {
        let mut lines = Vec::new();
        for from in cycle {
            let to: Vec<String> = self.arrows[from]
                .iter()
                .filter(|to| cycle.contains(to))
                .map(|to| to.display().to_string())
                .collect();
            lines.push(format!("    {} -> {}", from.display(), to.join(", ")));
        }
        lines.join("\n")
    }
}

/// Reads the file of `module` and those of its children in `folder`.
fn read_module(
    file: &Path,
    folder: &Path,
    src: &Path,
    module: Module,
    modules: &mut BTreeMap<Module, FileFacts>,
) -> Result<()> {
    let text = fs::read_to_string(file).with_context(|| file.display().to_string())?;
    let syntax = syn::parse_file(&text).with_context(|| file.display().to_string())?;
    let mut collector = Collector {
        module: module.clone(),
        facts: FileFacts {
            file: file.strip_prefix(src).unwrap_or(file).to_owned(),
            ..FileFacts::default()
        },
    };
    collector.visit_file(&syntax);
    let facts = collector.facts;
    for child in &facts.children {
        let flat = folder.join(format!("{child}.rs"));
        let nested = folder.join(child).join("mod.rs");
        let file = if flat.is_file() { flat } else { nested };
        let mut path = module.clone();
        path.push(child.clone());
        read_module(&file, &folder.join(child), src, path, modules)?;
    }
    modules.insert(module, facts);
    Ok(())
}

/// The file that defines the item at `path`.
fn definer<'a>(
    modules: &'a BTreeMap<Module, FileFacts>,
    path: &[String],
    depth: usize,
) -> Option<&'a FileFacts> {
    let known = (0..=path.len()).rev().find(|&n| modules.contains_key(&path[..n]))?;
    let facts = &modules[&path[..known]];
    let passed_on = path.get(known).and_then(|name| facts.imports.get(name));
    match passed_on {
        // Re-exports can refer to each other in a cycle.
        Some(origin) if depth < 16 => definer(modules, origin, depth + 1),
        _ => Some(facts),
    }
}

/// Collects [`FileFacts`] from a syntax tree.
struct Collector {
    module: Module,
    facts: FileFacts,
}

impl Collector {
    /// `segments` as a path from the crate root; `None` if it leads
    /// outside the crate or is local to the file.
    fn path_from_root(&self, segments: &[String]) -> Option<Vec<String>> {
        let mut base = self.module.clone();
        let mut rest = segments;
        match segments.first()?.as_str() {
            "crate" | "$crate" => {
                base.clear();
                rest = &segments[1..];
            }
            "self" => rest = &segments[1..],
            "super" => {
                while rest.first().is_some_and(|segment| segment == "super") {
                    base.pop();
                    rest = &rest[1..];
                }
            }
            child if self.facts.children.iter().any(|known| known == child) => {}
            _ => return None,
        }
        base.extend_from_slice(rest);
        Some(base)
    }

    fn name(&mut self, segments: &[String]) {
        self.facts.paths.extend(self.path_from_root(segments));
    }

    fn use_tree(&mut self, tree: &syn::UseTree, prefix: &mut Vec<String>) {
        match tree {
            syn::UseTree::Path(path) => {
                prefix.push(path.ident.to_string());
                self.use_tree(&path.tree, prefix);
                prefix.pop();
            }
            syn::UseTree::Group(group) => {
                for tree in &group.items {
                    self.use_tree(tree, prefix);
                }
            }
            syn::UseTree::Glob(_) => self.name(prefix),
            syn::UseTree::Name(name) => self.import(prefix, &name.ident, &name.ident),
            syn::UseTree::Rename(name) => self.import(prefix, &name.ident, &name.rename),
        }
    }

    fn import(&mut self, prefix: &[String], name: &syn::Ident, here: &syn::Ident) {
        let mut segments = prefix.to_vec();
        if name != "self" {
            segments.push(name.to_string());
        }
        if let Some(path) = self.path_from_root(&segments) {
            self.facts.paths.push(path.clone());
            self.facts.imports.insert(here.to_string(), path);
        }
    }

    /// Paths in the tokens of a macro, which `syn` does not parse.
    fn tokens(&mut self, tokens: &str) {
        let spaced = tokens.replace("$ crate", "crate").replace(" :: ", "::");
        for word in spaced.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':')) {
            let segments: Vec<String> =
                word.split("::").filter(|s| !s.is_empty()).map(str::to_owned).collect();
            if segments.len() > 1 {
                self.name(&segments);
            }
        }
    }
}

/// Whether an item exists in tests only.
fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("cfg")
            && attribute.parse_args::<syn::Path>().is_ok_and(|path| path.is_ident("test"))
    })
}

impl<'ast> Visit<'ast> for Collector {
    fn visit_file(&mut self, file: &'ast syn::File) {
        // Child modules first: a path may begin with a module's name before its declaration.
        for item in &file.items {
            if let syn::Item::Mod(module) = item
                && module.content.is_none()
                && !is_test(&module.attrs)
            {
                self.facts.children.push(module.ident.to_string());
            }
        }
        visit::visit_file(self, file);
    }

    fn visit_item_mod(&mut self, module: &'ast syn::ItemMod) {
        if is_test(&module.attrs) || module.content.is_none() {
            return;
        }
        self.module.push(module.ident.to_string());
        visit::visit_item_mod(self, module);
        self.module.pop();
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        self.use_tree(&item.tree, &mut Vec::new());
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let segments: Vec<String> =
            path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        if segments.len() > 1 {
            self.name(&segments);
        }
        visit::visit_path(self, path);
    }

    fn visit_visibility(&mut self, _: &'ast syn::Visibility) {
        // `pub(in super)` names a module without importing it.
    }

    fn visit_macro(&mut self, item: &'ast syn::Macro) {
        self.tokens(&item.tokens.to_string());
        visit::visit_macro(self, item);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::env;

    /// Import cycles of a crate made of `files` (name and text).
    fn cycles(name: &str, files: &[(&str, &str)]) -> Vec<Vec<String>> {
        let folder = env::temp_dir().join(format!("c4d-tidy-{name}-{}", std::process::id()));
        for (file, text) in files {
            let path = folder.join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        let graph = ImportGraph::read(&folder.join("lib.rs")).unwrap();
        fs::remove_dir_all(&folder).unwrap();
        let names = |cycle: Vec<PathBuf>| -> Vec<String> {
            cycle.iter().map(|file| file.to_str().unwrap().replace('\\', "/")).collect()
        };
        graph.cycles().into_iter().map(names).collect()
    }

    const ROOT: &str = "mod a; mod b; pub use a::A; pub use b::B;";

    #[test]
    fn files_that_import_each_other_are_a_cycle() {
        let found = cycles(
            "pair",
            &[
                ("lib.rs", ROOT),
                ("a.rs", "use crate::b::B; pub struct A(B);"),
                ("b.rs", "pub struct B; fn f() { let _ = crate::a::A; }"),
            ],
        );
        assert_eq!(found, [["a.rs", "b.rs"]], "a and b");
    }

    #[test]
    fn a_re_exported_name_belongs_to_the_file_that_defines_it() {
        let files = [
            ("lib.rs", ROOT),
            ("a.rs", "pub struct A;"),
            ("b.rs", "use crate::A; pub struct B(A);"),
        ];
        assert_eq!(cycles("re-export", &files), Vec::<Vec<String>>::new(), "no cycle");
        let files = [files[0], ("a.rs", "use super::{B, b::*};"), files[2]];
        assert_eq!(cycles("through-root", &files), [["a.rs", "b.rs"]], "through the root");
    }

    #[test]
    fn a_child_that_uses_its_parent_is_a_cycle() {
        let found = cycles(
            "parent",
            &[
                ("lib.rs", "mod a; pub struct Shared;"),
                ("a/mod.rs", "mod inner;"),
                ("a/inner.rs", "macro_rules! m { () => { $crate::Shared } }"),
            ],
        );
        assert_eq!(found, [["a/inner.rs", "a/mod.rs", "lib.rs"]], "all three");
    }

    #[test]
    fn tests_may_import_anything() {
        let found = cycles(
            "tests",
            &[
                ("lib.rs", ROOT),
                ("a.rs", "pub struct A; #[cfg(test)] mod tests { use crate::b::B; }"),
                ("b.rs", "use crate::a::A; pub struct B(A);"),
            ],
        );
        assert_eq!(found, Vec::<Vec<String>>::new(), "no cycle");
    }
}
