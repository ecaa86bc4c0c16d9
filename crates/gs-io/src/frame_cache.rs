//! A cache of the most recently used frames, for scenes that read or decode frames on demand.

use gs_core::Splats;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// Frames in memory, most recently used last.
#[derive(Debug)]
pub(crate) struct FrameCache {
    capacity: usize,
    frames: Mutex<VecDeque<(usize, Arc<Splats>)>>,
}

impl FrameCache {
    /// A cache of at least two frames, the neighbours of a time.
    pub(crate) fn new(capacity: usize) -> Self {
        Self { capacity: capacity.max(2), frames: Mutex::default() }
    }

    /// The frame from the cache, or else made by `make`.
    pub(crate) fn get<E>(
        &self,
        index: usize,
        make: impl FnOnce() -> Result<Splats, E>,
    ) -> Result<Arc<Splats>, E> {
        let lock = || self.frames.lock().unwrap_or_else(PoisonError::into_inner);
        {
            let mut frames = lock();
            if let Some(at) = frames.iter().position(|(held, _)| *held == index)
                && let Some(entry) = frames.remove(at)
            {
                let splats = Arc::clone(&entry.1);
                frames.push_back(entry);
                return Ok(splats);
            }
        }
        // Made without holding the lock, so that other threads
        // continue; at worst two make the same frame.
        let splats = Arc::new(make()?);
        let mut frames = lock();
        frames.retain(|(held, _)| *held != index);
        frames.push_back((index, Arc::clone(&splats)));
        if frames.len() > self.capacity {
            frames.pop_front();
        }
        Ok(splats)
    }
}
