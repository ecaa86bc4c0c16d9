//! `cfg_args` files.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = gs_io::cfg_args::parse(&String::from_utf8_lossy(bytes));
});
