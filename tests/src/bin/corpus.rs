//! Writes the seeds of the fuzz targets: `cargo run -p elm-tests --bin corpus`.

use std::fs;
use std::path::Path;

use elm_tests::any_bytes::READERS;

fn main() -> std::io::Result<()> {
    let corpus = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../fuzz/corpus"));
    for reader in READERS {
        let dir = corpus.join(reader.name);
        fs::create_dir_all(&dir)?;
        for seed in (reader.seeds)() {
            fs::write(dir.join(seed.name), seed.bytes)?;
        }
    }
    Ok(())
}
