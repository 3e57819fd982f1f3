//! Whatever is written is read back.

use std::f64::consts::{FRAC_PI_2, TAU};

use crate::support::all;
use elm_datasets::{Angles, DirectionPair, Invalid, curet, synthetic};
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_is_read_back_to_the_printed_precision(
        values in proptest::collection::vec(-1e6..1e6, 205),
        angles in proptest::collection::vec((0.0..FRAC_PI_2, -TAU..=TAU), 205),
        material in 0..61usize,
    ) {
        let mut set = synthetic::measurements(2, &all(), Invalid::Keep);
        for (row, (&value, &(theta, phi))) in values.iter().zip(&angles).enumerate() {
            set.materials[material].values[[row, 1]] = value;
            set.directions[row] = DirectionPair::from(Angles {
                theta_i: theta,
                phi_o: phi,
                ..Angles::of(&set.directions[row])
            });
        }
        let dir = tempfile::tempdir().unwrap();
        curet::write(dir.path(), &set).unwrap();
        let read = curet::read(dir.path(), &all(), Invalid::Keep).unwrap();
        for (a, b) in read.materials.iter().zip(&set.materials) {
            prop_assert!((&a.values - &b.values).iter().all(|difference| difference.abs() < 5.1e-4));
        }
        for (a, b) in read.directions.iter().zip(&set.directions) {
            let (a, b) = (Angles::of(a), Angles::of(b));
            prop_assert!((a.theta_i - b.theta_i).abs() < 5.1e-7);
            // As a length on the sphere, where half a turn is the same in either direction.
            let (sin, turned) = (b.theta_o.sin(), (a.phi_o - b.phi_o).rem_euclid(TAU));
            prop_assert!(turned.min(TAU - turned) * sin < 5.1e-7);
        }
    }
}
