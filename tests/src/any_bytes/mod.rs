//! What a reader of files must do on any bytes whatever.
//!
//! Either it gives a value that is sound, and comes back the same when it is written and read
//! again, or an error of one line; it never panics, never hangs, and never takes more memory than
//! a small multiple of the bytes that it was given. One [`Reader`] for each format says how that
//! is checked. The fuzz targets in `fuzz/` run them on whatever libFuzzer thinks of, the property
//! tests in `tests/any_bytes.rs` on a bounded number of random bytes and mutated seeds.

// What is expected here is what is tested.
#![allow(clippy::expect_used)]

mod networks;
mod reflectance;
mod tables;

use std::fmt::Display;

use peak_alloc::PeakAlloc;

/// Counts, for the bound on memory; in every binary that is linked with this library.
#[global_allocator]
pub static MEMORY: PeakAlloc = PeakAlloc;

/// A reader of one format, and what is known of it.
#[derive(Debug, Clone, Copy)]
pub struct Reader {
    /// The name of the fuzz target and of its corpus.
    pub name: &'static str,
    /// Files to begin with, made by the project itself; all but those named `bad-...` are whole.
    pub seeds: fn() -> Vec<Seed>,
    /// Reads, and panics unless what comes of it is as it must be. Whether a value was read.
    read: fn(&[u8]) -> bool,
}

/// A file to begin with.
#[derive(Debug, Clone)]
pub struct Seed {
    /// The name in the corpus.
    pub name: &'static str,
    /// What is in it.
    pub bytes: Vec<u8>,
}

/// All readers.
pub const READERS: [Reader; 11] = [
    networks::MODEL,
    networks::ACCUMULATOR,
    networks::UNCERTAIN,
    networks::CLASSIFIER,
    tables::TABLE,
    reflectance::CURET_TABLE,
    reflectance::CURET_VALUES,
    reflectance::SCATTERED,
    reflectance::MERL,
    reflectance::RGL,
    reflectance::PBRT,
];

/// The reader of that name.
#[must_use]
pub fn reader(name: &str) -> Option<Reader> {
    READERS.into_iter().find(|reader| reader.name == name)
}

impl Reader {
    /// Whether a value was read from these bytes.
    ///
    /// # Panics
    /// When the reader does not do what it must.
    pub fn check(self, bytes: &[u8]) -> bool {
        (self.read)(bytes)
    }
}

/// What reading may take: the numbers of a text are four times as long as `0,` in memory, vectors
/// grow by doubling, and the rest is for a second copy, an error, and other threads of a test.
fn most_memory(bytes: usize) -> usize {
    (1 << 20) + 32 * bytes
}

/// Reads within the bound on memory; an error must be one line of a reasonable length.
fn read<T, E: Display>(bytes: &[u8], read: impl FnOnce() -> Result<T, E>) -> Option<T> {
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    let result = read();
    let used = MEMORY.peak_usage().saturating_sub(before);
    let most = most_memory(bytes.len());
    assert!(
        used <= most,
        "{used} bytes of memory for {} read, expected at most {most}",
        bytes.len()
    );
    match result {
        Ok(value) => Some(value),
        Err(error) => {
            let text = error.to_string();
            assert!(!text.contains(['\n', '\r']), "more than a line: {text:?}");
            assert!(
                !text.is_empty() && text.len() < 1000,
                "{} bytes: {text:.200}",
                text.len()
            );
            None
        }
    }
}
