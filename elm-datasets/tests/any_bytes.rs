//! Whatever is in the files, reading them ends in data or in an error of one line; and whatever
//! is written is read back.

mod support;

use std::f64::consts::{FRAC_PI_2, TAU};
use std::fs;

use elm_datasets::{Invalid, curet, synthetic};
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
        changes in support::changes(),
        file in prop::sample::select(vec!["table.txt", "rbrdf.dat", "bbrdf.dat"]),
    ) {
        let dir = stand_in();
        change(dir.path(), file, |bytes| support::mutate(bytes, changes));
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

    #[test]
    fn what_is_written_is_read_back_to_the_printed_precision(
        values in proptest::collection::vec(-1e6..1e6, 205),
        angles in proptest::collection::vec((0.0..FRAC_PI_2, -TAU..=TAU), 205),
        material in 0..61usize,
    ) {
        let mut set = synthetic::measurements(2, &all(), Invalid::Keep);
        for (row, (&value, &(theta, phi))) in values.iter().zip(&angles).enumerate() {
            set.materials[material].values[[row, 1]] = value;
            set.directions[row].theta_i = theta;
            set.directions[row].phi_o = phi;
        }
        let dir = tempfile::tempdir().unwrap();
        curet::write(dir.path(), &set).unwrap();
        let read = curet::read(dir.path(), &all(), Invalid::Keep).unwrap();
        for (a, b) in read.materials.iter().zip(&set.materials) {
            prop_assert!((&a.values - &b.values).iter().all(|difference| difference.abs() < 5.1e-4));
        }
        for (a, b) in read.directions.iter().zip(&set.directions) {
            prop_assert!((a.theta_i - b.theta_i).abs() < 5.1e-7);
            prop_assert!((a.phi_o - b.phi_o).abs() < 5.1e-7);
        }
    }
}
