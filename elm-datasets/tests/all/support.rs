//! What the tests of files share.

use std::fs;
use std::path::Path;

use elm_datasets::{Invalid, MaterialId, curet, synthetic};
use proptest::prelude::*;

pub(crate) fn all() -> Vec<MaterialId> {
    MaterialId::all().collect()
}

/// A folder with the synthetic data in CUReT's layout, removed when dropped.
pub(crate) fn synthetic_folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let set = synthetic::measurements(1, &all(), Invalid::Keep);
    curet::write(dir.path(), &set).unwrap();
    dir
}

/// Rewrites one file of a folder.
pub(crate) fn change(dir: &Path, file: &str, edit: impl FnOnce(Vec<u8>) -> Vec<u8>) {
    let path = dir.join(file);
    let bytes = edit(fs::read(&path).unwrap());
    fs::write(&path, bytes).unwrap();
}

/// A place, a byte, and whether it replaces, is inserted or removes.
pub(crate) type Change = (prop::sample::Index, u8, u8);

pub(crate) fn changes() -> impl Strategy<Value = Vec<Change>> {
    proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..3u8), 1..8)
}

pub(crate) fn mutate(mut bytes: Vec<u8>, changes: Vec<Change>) -> Vec<u8> {
    for (place, byte, kind) in changes {
        if bytes.is_empty() {
            break;
        }
        let place = place.index(bytes.len());
        match kind {
            0 => bytes[place] = byte,
            1 => bytes.insert(place, byte),
            _ => {
                bytes.remove(place);
            }
        }
    }
    bytes
}
