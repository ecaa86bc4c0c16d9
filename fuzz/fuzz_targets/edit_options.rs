//! Expressions, action arguments and row lists of `c4d edit`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let text = String::from_utf8_lossy(bytes);
    if let Err(error) = gs_edit::Selector::parse(&text) {
        assert!((1..=text.chars().count() + 1).contains(&error.column), "a column of the text");
    }
    for option in gs_edit::ACTION_OPTIONS {
        let _ = gs_edit::Action::parse(option.name, &text);
    }
    let _ = gs_edit::parse_ids(&text);
});
