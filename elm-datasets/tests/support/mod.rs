//! What the tests of the CUReT files share.
#![allow(dead_code, unreachable_pub, clippy::unwrap_used, clippy::print_stderr)]

use std::fs;
use std::path::{Path, PathBuf};

use elm_datasets::{Invalid, MaterialId, curet, synthetic};

pub fn all() -> Vec<MaterialId> {
    MaterialId::all().collect()
}

/// A folder with the stand-in in CUReT's layout, removed when dropped.
pub fn stand_in() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let set = synthetic::measurements(1, &all(), Invalid::Keep);
    curet::write(dir.path(), &set).unwrap();
    dir
}

/// Rewrites one file of a folder.
pub fn change(dir: &Path, file: &str, edit: impl FnOnce(Vec<u8>) -> Vec<u8>) {
    let path = dir.join(file);
    let bytes = edit(fs::read(&path).unwrap());
    fs::write(&path, bytes).unwrap();
}

/// The database's folder, or `None` after saying that the test is skipped.
pub fn real() -> Option<PathBuf> {
    let shared = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared");
    let given = std::env::var_os("ELM_BRDF_DATA").map_or_else(|| shared.into(), PathBuf::from);
    let found = [given.join("curet"), given.clone()]
        .into_iter()
        .find(|dir| curet::is_present(dir));
    if found.is_none() {
        eprintln!("skipped: no CUReT files in {}", given.display());
    }
    found
}
