//! Flags of `c4d completions` and `c4d man`.

use super::Overwriting;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(
    after_help = "bash: c4d completions bash > ~/.local/share/bash-completion/completions/c4d
zsh: c4d completions zsh > a folder of $fpath, as _c4d
fish: c4d completions fish > ~/.config/fish/completions/c4d.fish
PowerShell: c4d completions powershell | Out-String | Invoke-Expression, in $PROFILE"
)]
pub(crate) struct CompletionsArgs {
    /// Shell to print completions for
    pub(crate) shell: clap_complete::Shell,
}

#[derive(Debug, Args)]
pub(crate) struct ManArgs {
    /// Folder to write, with `man1/c4d.1` and one page per command
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) writes: Overwriting,
}
