//! Linker arguments of an extension module (macOS resolves Python's symbols when it is loaded).

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
