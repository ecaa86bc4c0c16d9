//! Tests of the pickle machine.

use super::*;

fn run(pickle: &[u8]) -> Result<Root<'_>, PthError> {
    Ok(load(pickle, &|_, _| None)?.0)
}

#[test]
fn nothing_is_executed() {
    let error = run(b"cos\nsystem\n(X\x02\x00\x00\x00lstR.").unwrap_err().to_string();
    assert!(error.contains("`os.system`") && error.contains("refused"), "{error}");
    let error = run(b"\x80\x02i.").unwrap_err().to_string();
    assert!(error.contains("opcode 0x69"), "{error}");
}

#[test]
fn stacks_and_memos_are_checked() {
    for pickle in [
        &b""[..],
        b".",
        b"R.",
        b"t.",
        b"(s.",
        b"h\x07.",
        b"q\x00.",
        b"}(Nu.",
        b"]N\x86R.",
        b"NQ.",
        b"X\xff\xff\xff\xffab.",
        b"\x8a\x09123456789.",
        b"(((.",
        b"ctorch\nFloatStorage\n)R.",
    ] {
        assert!(run(pickle).is_err(), "{pickle:?}");
    }
}

#[test]
fn shared_and_deeply_nested_objects_take_linear_time() {
    // A tuple of itself twice, forty times over: 2⁴⁰ leaves if anything were copied.
    let mut doubled = b"N\x85q\x00".to_vec();
    for _ in 0..40 {
        doubled.extend_from_slice(b"h\x00\x86q\x00");
    }
    doubled.push(b'.');
    assert!(matches!(run(&doubled), Err(PthError::Root { .. })), "a tuple is not a checkpoint");
    let mut deep = b"N".to_vec();
    deep.extend(std::iter::repeat_n(0x85, 200_000));
    deep.push(b'.');
    assert!(matches!(run(&deep), Err(PthError::Root { .. })), "no stack overflow");
}

#[test]
fn integers_of_any_length() {
    assert_eq!(long(&[]), Some(0), "empty");
    assert_eq!(long(&[0xff]), Some(-1), "negative");
    assert_eq!(long(&[0xff, 0]), Some(255), "positive");
    assert_eq!(long(&[0; 9]), None, "too long");
}
