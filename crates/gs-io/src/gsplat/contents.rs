//! [`Contents`] of a checkpoint, from its first bytes.

/// Number of bytes at the start of a file that are searched for names.
const HEAD: usize = 1 << 16;

/// Contents of a checkpoint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Contents {
    /// One frame.
    Still,
    /// Splats with times and velocities.
    Moving,
}

/// Contents according to the first bytes of a PyTorch archive, which
/// contain the names; `None` for other archives.
pub(crate) fn contents(start: &[u8]) -> Option<Contents> {
    let start = &start[..start.len().min(HEAD)];
    let has = |name: &str| {
        // Encoding of text in pickles: length, then bytes.
        let mut written = vec![b'X'];
        written.extend(u32::try_from(name.len()).unwrap_or_default().to_le_bytes());
        written.extend(name.bytes());
        start.windows(written.len()).any(|window| window == written)
    };
    if !["means", "quats", "scales", "sh0"].into_iter().all(has) {
        return None;
    }
    let moves = has("times") || has("durations") || has("velocities");
    Some(if moves { Contents::Moving } else { Contents::Still })
}
