//! The program `c4d`: propagates an edit of one frame of a dynamic Gaussian-splat scene to all
//! other times. Everything is in the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    c4d_cli::main()
}
