//! PyTorch archives.
#![no_main]

use gs_io::pth;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    match pth::read(bytes) {
        Ok(pth::Root::StateDict(tensors)) => {
            let values: usize = tensors.iter().map(|(_, tensor)| tensor.to_f32s().len()).sum();
            assert!(values <= bytes.len() * 200, "{values} values of {} bytes", bytes.len());
        }
        Ok(pth::Root::Tensor(tensor)) => {
            let _ = tensor.to_f32s();
        }
        Err(_) => {}
    }
});
