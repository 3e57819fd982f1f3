//! What is known of the real files holds when they are read. Every test here needs them.

#![allow(clippy::approx_constant)]

use std::fs;

use crate::support::all;
use elm_datasets::curet::{self, rig};
use elm_datasets::{Angles, DirectionPair, Invalid, MaterialId, Measurements, Origin};
use elm_test_support::curet as real;

fn read(invalid: Invalid) -> Option<(std::path::PathBuf, Measurements)> {
    let dir = real()?;
    let set = curet::read(&dir, &all(), invalid).unwrap();
    Some((dir, set))
}

#[test]
#[ignore = "needs data: CUReT"]
fn all_materials_have_all_measurements() {
    let Some((_, set)) = read(Invalid::Clamp) else {
        return;
    };
    assert_eq!(set.origin, Origin::Curet);
    assert_eq!((set.materials.len(), set.directions.len()), (61, 205));
    for (index, material) in set.materials.iter().enumerate() {
        assert_eq!(material.id.number(), index + 1);
        assert_eq!(material.values.dim(), (205, set.channels.len()));
        assert!(material.values.iter().all(|&value| value >= 0.0));
    }
}

#[test]
#[ignore = "needs data: CUReT"]
fn the_negative_values_are_those_counted_by_hand() {
    let Some((_, kept)) = read(Invalid::Keep) else {
        return;
    };
    if kept.channels != ["average"] {
        return;
    }
    assert_eq!(kept.invalid, 29);
    for material in &kept.materials {
        let negative: Vec<_> = (0..205)
            .filter(|&row| material.values[[row, 0]] < 0.0)
            .map(|row| row + 1)
            .collect();
        match material.id.number() {
            4 => assert_eq!(negative, [192]),
            61 => assert_eq!(negative.len(), 28),
            number => assert!(negative.is_empty(), "{number}"),
        }
    }
    let Some((_, dropped)) = read(Invalid::Drop) else {
        return;
    };
    assert_eq!(dropped.invalid, 29);
    assert_eq!(dropped.materials[3].rows.len(), 204);
    assert!(!dropped.materials[3].rows.contains(&191));
    assert_eq!(dropped.materials[60].rows.len(), 205 - 28);
}

#[test]
#[ignore = "needs data: CUReT"]
fn single_values_are_where_the_file_has_them() {
    let Some((_, set)) = read(Invalid::Keep) else {
        return;
    };
    if set.channels == ["average"] {
        assert_eq!(set.materials[0].values[[0, 0]], 0.200);
        assert_eq!(set.materials[10].values[[204, 0]], 0.083);
    }
    let first = Angles::of(&set.directions[0]);
    assert_eq!((first.theta_o, first.phi_o), (1.389566, -1.970402));
    assert_eq!((first.theta_i, first.phi_i), (1.374447, -1.570796));
}

/// Greatest difference in the three numbers that an isotropic surface sees, in radians.
fn apart(a: &DirectionPair, b: &DirectionPair) -> f64 {
    let (of_a, of_b) = (Angles::of(a), Angles::of(b));
    let [theta_i, theta_o] = [of_a.theta_i - of_b.theta_i, of_a.theta_o - of_b.theta_o];
    let between = a.cos_between().acos() - b.cos_between().acos();
    [theta_i, theta_o, between]
        .into_iter()
        .fold(0.0, |worst, part| part.abs().max(worst))
}

#[test]
#[ignore = "needs data: CUReT"]
fn the_rig_has_the_tables_directions_in_the_tables_order() {
    let Some((_, set)) = read(Invalid::Clamp) else {
        return;
    };
    let rig = rig::directions();
    for (index, real) in set.directions.iter().enumerate() {
        // Equally high lamps, told apart in the database by rounding: in another order here.
        let same = if (26..30).contains(&index) {
            &rig[26..30]
        } else {
            &rig[index..=index]
        };
        let azimuths_agree = |made: &DirectionPair| {
            let (real, made) = (Angles::of(real), Angles::of(made));
            // As lengths on the sphere: without a polar angle there is no azimuth.
            [
                (real.phi_i - made.phi_i, made.theta_i),
                (real.phi_o - made.phi_o, made.theta_o),
            ]
            .into_iter()
            .all(|(turned, theta)| (2.0 * (turned / 2.0).sin() * theta.sin()).abs() < 3e-6)
        };
        let found = same
            .iter()
            .any(|made| apart(real, made) < 3e-6 && azimuths_agree(made));
        assert!(found, "{} {real:?}", index + 1);
    }
}

#[test]
#[ignore = "needs data: CUReT"]
fn thirty_pairs_of_measurements_are_reciprocal_and_two_more_nearly() {
    let Some((_, set)) = read(Invalid::Clamp) else {
        return;
    };
    for directions in [set.directions, rig::directions()] {
        let pairs = |tolerance| {
            directions
                .iter()
                .enumerate()
                .flat_map(|(k, a)| directions[..k].iter().map(move |b| apart(a, &b.swapped())))
                .filter(|&apart| apart < tolerance)
                .count()
        };
        assert_eq!((pairs(1e-5), pairs(1e-3), pairs(6e-3)), (30, 30, 32));
    }
}

#[test]
#[ignore = "needs data: CUReT"]
fn the_angles_reach_as_far_as_stated_and_the_blocks_are_the_stations() {
    let Some((_, set)) = read(Invalid::Clamp) else {
        return;
    };
    let highest = |angle: fn(&Angles) -> f64| {
        set.directions
            .iter()
            .map(|pair| angle(&Angles::of(pair)))
            .fold(0.0, f64::max)
            .to_degrees()
    };
    assert!((highest(|d| d.theta_i) - 78.75).abs() < 1e-3);
    assert!((highest(|d| d.theta_o) - 83.9).abs() < 0.05);
    let stations = rig::BLOCKS
        .iter()
        .enumerate()
        .flat_map(|(s, &count)| vec![s; count]);
    for (station, d) in stations.zip(&set.directions) {
        assert!((d.cos_between().acos() - rig::station_angle(station)).abs() < 1e-5);
    }
}

#[test]
#[ignore = "needs data: CUReT"]
fn written_out_again_the_files_are_the_same_bytes() {
    let Some((dir, set)) = read(Invalid::Keep) else {
        return;
    };
    let copy = tempfile::tempdir().unwrap();
    curet::write(copy.path(), &set).unwrap();
    for entry in fs::read_dir(copy.path()).unwrap() {
        let name = entry.unwrap().file_name();
        let (ours, theirs) = (
            fs::read(copy.path().join(&name)).unwrap(),
            fs::read(dir.join(&name)).unwrap(),
        );
        assert!(ours == theirs, "{} differs", name.display());
    }
}

#[test]
#[ignore = "needs data: CUReT"]
fn only_what_is_asked_for_is_read_in_the_order_asked_for() {
    let Some(dir) = real() else { return };
    let ids = [41, 15, 41, 1].map(|number| MaterialId::new(number).unwrap());
    let set = curet::read(&dir, &ids, Invalid::Clamp).unwrap();
    let names: Vec<_> = set
        .materials
        .iter()
        .map(|material| material.name.as_str())
        .collect();
    assert_eq!(names, ["Brick B", "Aluminum Foil", "Felt"]);
    assert_eq!(set.samples(1).unwrap().values, set.materials[1].values);
    assert_eq!(set.samples(3), None);
}
