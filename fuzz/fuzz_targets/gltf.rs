//! The JSON of a binary glTF with a fixed data chunk: accessors,
//! views, nodes and attributes are mutated.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let data: Vec<u8> = (0..512_u16).flat_map(|i| (f32::from(i) / 256.0 - 1.0).to_le_bytes()).collect();
    let mut glb = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
    for (kind, chunk) in [(0x4E4F_534A_u32, bytes), (0x004E_4942, &data[..])] {
        glb.extend(u32::try_from(chunk.len()).unwrap_or(u32::MAX).to_le_bytes());
        glb.extend(kind.to_le_bytes());
        glb.extend(chunk);
    }
    for file in [&glb[..], bytes] {
        let no_other_file = |_: &str| Err(String::new());
        if let Ok(read) = gs_io::gltf::read(file, &no_other_file) {
            assert!(read.splats.check_shapes().is_ok(), "splats that were read are consistent");
            let most = 64 * file.len().max(1 << 18);
            assert!(read.splats.len() < most, "in proportion to the file");
            let _ = read.in_axes(gs_io::Axes::PLY).sanitize(gs_io::repair::Damage::Drop);
        }
    }
});
