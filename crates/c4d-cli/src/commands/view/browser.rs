//! Opens a URL in the user's browser.

use std::io::IsTerminal;
use std::process::{Command, Stdio};

/// Opens `address`, unless the session is remote. Failure to start a browser is not an error,
/// because the address is also printed.
pub(super) fn open(address: &str) {
    if !std::io::stdout().is_terminal() || is_remote() {
        return;
    }
    let mut command = if cfg!(target_os = "macos") {
        Command::new("open")
    } else if cfg!(windows) {
        let mut command = Command::new("rundll32");
        command.arg("url.dll,FileProtocolHandler");
        command
    } else {
        Command::new("xdg-open")
    };
    let _ = command
        .arg(address)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
}

/// Whether the terminal session is remote.
pub(super) fn is_remote() -> bool {
    std::env::var_os("SSH_CONNECTION").is_some()
}
