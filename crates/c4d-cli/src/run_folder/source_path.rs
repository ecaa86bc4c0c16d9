//! Paths between a run and its source.

use super::RunConfig;
use super::files::CONFIG;
use crate::failure::{Failure, Outcome};
use std::path::{Component, Path, PathBuf};

/// The source of the run in `run`: the recorded path relative to the run, else the absolute path.
pub(super) fn locate(run: &Path, config: &RunConfig) -> Outcome<PathBuf> {
    let relative = run.join(&config.source_from_run);
    if relative.exists() {
        return Ok(relative);
    }
    if config.source.exists() {
        return Ok(config.source.clone());
    }
    Err(Failure::bad_input(format!(
        "the source scene of {} is missing: neither {} nor {} exists",
        run.display(),
        relative.display(),
        config.source.display()
    ))
    .next(format!("Put it back, or correct `source` in {}.", run.join(CONFIG).display())))
}

/// `target` relative to the folder `from`; both absolute. `target` itself if they share no root.
pub(crate) fn relative(from: &Path, target: &Path) -> PathBuf {
    let (from, target): (Vec<Component<'_>>, Vec<Component<'_>>) =
        (from.components().collect(), target.components().collect());
    let shared = from.iter().zip(&target).take_while(|(a, b)| a == b).count();
    let up = std::iter::repeat_n(Component::ParentDir, from.len() - shared);
    up.chain(target[shared..].iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn relative_paths() {
        let relative = |from: &str, target: &str| relative(Path::new(from), Path::new(target));
        assert_eq!(relative("/a/b/run", "/a/b/source"), Path::new("../source"), "siblings");
        assert_eq!(relative("/a/run", "/c/d"), Path::new("../../c/d"), "far");
    }
}
