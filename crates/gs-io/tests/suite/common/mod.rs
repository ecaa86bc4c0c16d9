//! Writes PyTorch archives, and scenes for tests of other files.

pub(crate) mod changing_scene;
#[allow(dead_code, reason = "the rest is used by an example and by tests of `c4d-cli`")]
pub(crate) mod layouts;
#[allow(dead_code, reason = "the rest is used by tests of `c4d-cli`")]
pub(crate) mod tsog;

/// A state dictionary in the format of `torch.save`: stored zip with
/// sizes in data descriptors, pickle protocol 2.
pub(crate) fn state_dict(tensors: &[(String, Vec<usize>, Vec<f32>)]) -> Vec<u8> {
    wrapped_state_dict(b"", tensors, b"")
}

/// As [`state_dict`], with opcodes before and after the dictionary.
pub(crate) fn wrapped_state_dict(
    before: &[u8],
    tensors: &[(String, Vec<usize>, Vec<f32>)],
    behind: &[u8],
) -> Vec<u8> {
    let mut pickle = [b"\x80\x02", before].concat();
    pickle.extend_from_slice(b"ccollections\nOrderedDict\nq\x00)Rq\x01(");
    for (index, (name, shape, values)) in tensors.iter().enumerate() {
        text(&mut pickle, name);
        pickle.extend_from_slice(b"ctorch._utils\n_rebuild_tensor_v2\n((");
        text(&mut pickle, "storage");
        pickle.extend_from_slice(b"ctorch\nFloatStorage\n");
        text(&mut pickle, &index.to_string());
        text(&mut pickle, "cuda:0");
        int(&mut pickle, values.len());
        pickle.extend_from_slice(b"tQK\x00(");
        for &length in shape {
            int(&mut pickle, length);
        }
        pickle.extend_from_slice(b"t(");
        for axis in 0..shape.len() {
            int(&mut pickle, shape[axis + 1..].iter().product());
        }
        pickle.extend_from_slice(b"t\x89h\x00)Rtq\x02R");
    }
    pickle.extend_from_slice(b"u}(");
    text(&mut pickle, "_metadata");
    pickle.extend_from_slice(b"h\x00)Rub");
    pickle.extend_from_slice(behind);
    pickle.push(b'.');
    let mut entries = vec![("archive/data.pkl".to_owned(), pickle)];
    for (index, (_, _, values)) in tensors.iter().enumerate() {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        entries.push((format!("archive/data/{index}"), bytes));
    }
    zip(&entries)
}

pub(crate) fn text(pickle: &mut Vec<u8>, value: &str) {
    pickle.push(b'X');
    pickle.extend_from_slice(&u32::try_from(value.len()).unwrap().to_le_bytes());
    pickle.extend_from_slice(value.as_bytes());
}

fn int(pickle: &mut Vec<u8>, value: usize) {
    pickle.push(b'J');
    pickle.extend_from_slice(&i32::try_from(value).unwrap().to_le_bytes());
}

fn zip(entries: &[(String, Vec<u8>)]) -> Vec<u8> {
    let (mut bytes, mut central) = (Vec::new(), Vec::new());
    let u16s = |values: &[u16]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let u32s = |values: &[u32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    for (name, data) in entries {
        let offset = u32::try_from(bytes.len()).unwrap();
        let size = u32::try_from(data.len()).unwrap();
        let name_length = u16::try_from(name.len()).unwrap();
        bytes.extend(u32s(&[0x0403_4b50]));
        bytes.extend(u16s(&[20, 8, 0, 0, 0]));
        bytes.extend(u32s(&[0, 0, 0]));
        bytes.extend(u16s(&[name_length, 4]));
        bytes.extend(name.bytes());
        bytes.extend([b'F', b'B', 0, 0]);
        bytes.extend(data);
        bytes.extend(u32s(&[0x0807_4b50, 0, size, size]));
        central.extend(u32s(&[0x0201_4b50]));
        central.extend(u16s(&[20, 20, 8, 0, 0, 0]));
        central.extend(u32s(&[0, size, size]));
        central.extend(u16s(&[name_length, 0, 0, 0, 0, 0, 0]));
        central.extend(u32s(&[offset]));
        central.extend(name.bytes());
    }
    let (offset, size) =
        (u32::try_from(bytes.len()).unwrap(), u32::try_from(central.len()).unwrap());
    bytes.extend(central);
    let count = u16::try_from(entries.len()).unwrap();
    bytes.extend(u32s(&[0x0605_4b50]));
    bytes.extend(u16s(&[0, 0, count, count]));
    bytes.extend(u32s(&[size, offset]));
    bytes.extend([0, 0]);
    bytes
}
