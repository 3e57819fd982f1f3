//! Whatever is in the files, reading them ends in data or in an error of one line.

mod support;

use std::fs;

use elm_datasets::{Invalid, curet};
use proptest::prelude::*;
use support::{all, change, stand_in};

/// Reads the folder; what comes must be sound.
fn check(dir: &std::path::Path) {
    match curet::read(dir, &all(), Invalid::Clamp) {
        Ok(set) => {
            assert_eq!((set.directions.len(), set.materials.len()), (205, 61));
            for material in &set.materials {
                assert!(
                    material
                        .values
                        .iter()
                        .all(|value| value.is_finite() && *value >= 0.0)
                );
            }
        }
        Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn arbitrary_bytes_are_no_reason_to_panic(
        bytes in proptest::collection::vec(any::<u8>(), 0..2000),
        file in prop::sample::select(vec!["table.txt", "rbrdf.dat"]),
    ) {
        let dir = stand_in();
        fs::write(dir.path().join(file), bytes).unwrap();
        check(dir.path());
    }

    #[test]
    fn mutations_of_a_valid_file_are_no_reason_to_panic(
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..3u8), 1..8),
        file in prop::sample::select(vec!["table.txt", "rbrdf.dat", "bbrdf.dat"]),
    ) {
        let dir = stand_in();
        change(dir.path(), file, |mut bytes| {
            for (place, byte, kind) in changes {
                let place = place.index(bytes.len());
                match kind {
                    0 => bytes[place] = byte,
                    1 => bytes.insert(place, byte),
                    _ => { bytes.remove(place); }
                }
            }
            bytes
        });
        check(dir.path());
    }

    #[test]
    fn a_file_broken_off_anywhere_is_no_reason_to_panic(share in 0.0..1.0) {
        let dir = stand_in();
        change(dir.path(), "rbrdf.dat", |mut bytes| {
            bytes.truncate((bytes.len() as f64 * share) as usize);
            bytes
        });
        check(dir.path());
    }
}
