//! The MERL format: coordinates as published, damage refused, tables written and read again.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::Path;

use elm_datasets::merl::{Merl, Problem, cell};
use elm_datasets::{Angles, DirectionPair, Error, Sampling, lobes};
use proptest::prelude::*;

const CELLS: usize = 90 * 90 * 180;
const LENGTH: u64 = 12 + 3 * 8 * 1_458_000;

/// A file whose numbers are their own places in each channel, made without the crate.
fn places(path: &Path) {
    let mut file = BufWriter::new(File::create(path).unwrap());
    for size in [90_i32, 90, 180] {
        file.write_all(&size.to_le_bytes()).unwrap();
    }
    for _ in 0..3 {
        for place in 0..CELLS {
            file.write_all(&(place as f64).to_le_bytes()).unwrap();
        }
    }
    file.into_inner().unwrap();
}

type Vector = [f64; 3];

fn dot(a: Vector, b: Vector) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

fn cross(a: Vector, b: Vector) -> Vector {
    [1, 2, 0].map(|k| a[k] * b[(k + 1) % 3] - a[(k + 1) % 3] * b[k])
}

fn unit(a: Vector) -> Vector {
    let length = dot(a, a).sqrt();
    a.map(|part| part / length)
}

fn vector(theta: f64, phi: f64) -> Vector {
    let [st, ct, sp, cp] = [theta.sin(), theta.cos(), phi.sin(), phi.cos()];
    [st * cp, st * sp, ct]
}

/// The three real numbers whose whole parts are the indices, from the frame (t, b, h) around the
/// half vector: b is horizontal, t points down the slope of h.
fn coordinates(pair: &DirectionPair) -> [f64; 3] {
    let d = Angles::of(pair);
    let (light, viewer) = (vector(d.theta_i, d.phi_i), vector(d.theta_o, d.phi_o));
    let h = unit([0, 1, 2].map(|k| light[k] + viewer[k]));
    let b = unit(cross([0.0, 0.0, 1.0], h));
    // cross(..) above cycles backwards, and so does this: t is right-handed all the same.
    let t = cross(b, h);
    let theta_h = h[2].acos();
    let theta_d = dot(light, h).acos();
    let phi_d = dot(light, b).atan2(dot(light, t)).rem_euclid(PI);
    [
        90.0 * (theta_h / FRAC_PI_2).sqrt(),
        90.0 * theta_d / FRAC_PI_2,
        180.0 * phi_d / PI,
    ]
}

fn random(rows: usize) -> Vec<DirectionPair> {
    Sampling::Random { rows, seed: 7 }.directions().unwrap()
}

#[test]
fn directions_fall_into_the_cells_that_the_publication_says() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("places.binary");
    places(&path);
    let table = Merl::read(&path).unwrap();
    assert_eq!(table.invalid(), 0);
    let mut seen = 0;
    for pair in random(4000) {
        let real = coordinates(&pair);
        // Rounding decides which side of an edge a direction is on.
        if real.iter().any(|x| (x - x.round()).abs() < 1e-6) {
            continue;
        }
        let [h, d, phi] = real.map(|x| x as usize);
        let place = ((h * 90 + d) * 180 + phi) as f64;
        let [red, green, blue] = table.at(&pair);
        for (value, per_unit) in [(red, 1.0), (green, 1.15), (blue, 1.66)] {
            assert!((value * 1500.0 / per_unit - place).abs() < 1e-6, "{pair:?}");
        }
        // Light and viewer exchanged: phi_d turns by pi, the same entry.
        assert_eq!(table.at(&pair.swapped()), [red, green, blue]);
        seen += 1;
    }
    assert!(seen > 3900);
}

#[test]
fn cells_in_the_plane_of_incidence_are_those_worked_out_by_hand() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("places.binary");
    places(&path);
    let table = Merl::read(&path).unwrap();
    // Light at a, viewer opposite at b < a: theta_h = (a - b) / 2, theta_d = (a + b) / 2. The
    // azimuth phi_d = 0 is the edge of its first and last cell.
    for (a, b, row) in [
        // sqrt(10 / 90) * 90 = 30 exactly, so 10.01 for the side of the edge; theta_d = 40.01.
        (50.02_f64, 30.0_f64, 30 * 90 + 40),
        // theta_h = 22.6: 90 sqrt(0.2511) = 45.1; theta_d = 22.6.
        (45.2, 0.0, 45 * 90 + 22),
        // theta_h = 0.005: 90 sqrt(5.6e-5) = 0.67; theta_d = 60.005.
        (60.01, 60.0, 60),
    ] {
        let pair = DirectionPair::from(Angles {
            theta_i: a.to_radians(),
            phi_i: 0.0,
            theta_o: b.to_radians(),
            phi_o: PI,
        });
        let [red, ..] = table.at(&pair);
        assert_eq!(
            ((red * 1500.0).round() / 180.0).floor(),
            f64::from(row),
            "{a} {b}"
        );
    }
}

fn ggx(d: &DirectionPair) -> [f64; 3] {
    let gloss = lobes::ggx(d, 0.05, 0.3);
    [gloss, gloss + 0.1, gloss + 0.2]
}

#[test]
fn a_tabulated_model_has_its_own_value_in_the_middle_of_each_cell_and_none_below() {
    let table = Merl::from_fn(ggx);
    let mut below = 0;
    for index in 0..CELLS {
        match cell(index / 16_200, index / 180 % 90, index % 180) {
            // Every seventh, for the time it takes.
            Some(pair) if index % 7 == 0 => {
                for (found, expected) in table.at(&pair).into_iter().zip(ggx(&pair)) {
                    // Division and multiplication by the scale.
                    assert!((found - expected).abs() <= 1e-14 * expected, "{index}");
                }
            }
            Some(_) => {}
            None => below += 1,
        }
    }
    assert_eq!(table.invalid(), 3 * below);
    assert_eq!(cell(90, 0, 0), None);
    assert_eq!(cell(0, 90, 0), None);
    assert_eq!(cell(0, 0, 180), None);
}

#[test]
fn what_is_written_is_read_back_and_unmeasured_entries_are_left_out_of_samples() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("half.binary");
    // Nothing where the light is beyond 45 degrees, in green only.
    let table = Merl::from_fn(|d| {
        let green = if Angles::of(d).theta_i > 0.785 {
            f64::NAN
        } else {
            0.2
        };
        [0.1, green, 0.3]
    });
    table.write(&path).unwrap();
    assert_eq!(fs::metadata(&path).unwrap().len(), LENGTH);
    let read = Merl::read(&path).unwrap();
    assert_eq!(read, table);
    let sampling = Sampling::Random { rows: 500, seed: 1 };
    let (samples, left_out) = read.samples(&sampling).unwrap();
    assert_eq!(samples.directions.len() + left_out, 500);
    assert!((100..400).contains(&left_out), "{left_out}");
    assert_eq!(samples.channels, ["red", "green", "blue"]);
    for row in samples.values.rows() {
        for (found, expected) in row.iter().zip([0.1, 0.2, 0.3]) {
            assert!((found - expected).abs() < 1e-15);
        }
    }
}

#[test]
fn directions_without_a_cell_are_not_numbers_and_no_reason_to_panic() {
    let table = Merl::from_fn(ggx);
    for (theta_i, phi_o) in [(f64::NAN, 0.0), (f64::INFINITY, 0.0), (0.1, f64::NAN)] {
        let pair = DirectionPair::from(Angles {
            theta_i,
            phi_i: 0.0,
            theta_o: 0.2,
            phi_o,
        });
        assert!(table.at(&pair).iter().all(|value| value.is_nan()));
    }
    let below = DirectionPair::from(Angles {
        theta_i: 3.0,
        phi_i: 0.0,
        theta_o: 3.0,
        phi_o: 1.0,
    });
    assert!(table.at(&below).iter().all(|&value| value < 0.0));
}

/// A file of this length that begins with these bytes; the rest is a hole.
fn file(path: &Path, start: &[u8], length: u64) {
    let mut file = File::create(path).unwrap();
    file.write_all(start).unwrap();
    file.set_len(length).unwrap();
}

fn header(dimensions: [i32; 3]) -> Vec<u8> {
    dimensions.into_iter().flat_map(i32::to_le_bytes).collect()
}

#[test]
fn damage_is_reported_before_anything_is_allocated() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.binary");
    let good = header([90, 90, 180]);
    for (start, length, fragments) in [
        (vec![], 0, ["expected 34992012 bytes", "found 0"]),
        (good.clone(), 11, ["34992012 bytes", "found 11"]),
        (good.clone(), 12, ["34992012 bytes", "found 12"]),
        (good.clone(), LENGTH - 1, ["34992012", "found 34992011"]),
        (good.clone(), LENGTH + 1, ["34992012", "found 34992013"]),
        // A hole of a terabyte takes no room on the disk and must take none in memory.
        (good, 1 << 40, ["34992012 bytes", "found 1099511627776"]),
        (
            header([90, 90, 360]),
            LENGTH,
            ["[90, 90, 180]", "[90, 90, 360]"],
        ),
        (
            header([i32::MAX; 3]),
            LENGTH,
            ["at byte 0", "[2147483647, 2147483647, 2147483647]"],
        ),
        (header([-1, 90, 180]), 12, ["at byte 0", "[-1, 90, 180]"]),
    ] {
        file(&path, &start, length);
        let message = Merl::read(&path).unwrap_err().to_string();
        for fragment in fragments.iter().chain(&["x.binary"]) {
            assert!(message.contains(fragment), "{fragment:?}: {message}");
        }
        assert!(!message.contains('\n'));
    }
    let error = Merl::read(dir.path().join("none.binary")).unwrap_err();
    assert!(matches!(error, Error::Read { .. }), "{error}");
}

proptest! {
    // Each case with the right header reads 35 MB.
    #![proptest_config(ProptestConfig { cases: 32, ..ProptestConfig::default() })]

    #[test]
    fn mutations_are_no_reason_to_panic(
        changes in crate::support::changes(),
        length in prop::sample::select(vec![0, 11, 13, LENGTH - 8, LENGTH]),
    ) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.binary");
        let mut start = header([90, 90, 180]);
        start.extend([0; 64]);
        file(&path, &crate::support::mutate(start, changes), length);
        match Merl::read(&path) {
            Ok(table) => {
                let pair = DirectionPair::from(Angles { theta_i: 0.1, phi_i: 0.0, theta_o: 0.1, phi_o: 2.0 });
                let _ = table.at(&pair);
                prop_assert!(table.invalid() <= 3 * CELLS);
            }
            Err(Error::Merl { problem: Problem::Length { found }, .. }) => prop_assert_eq!(found, length),
            Err(error) => prop_assert!(!error.to_string().contains('\n')),
        }
    }

    #[test]
    fn any_direction_has_a_value(angles in prop::array::uniform4(any::<f64>())) {
        let [theta_i, phi_i, theta_o, phi_o] = angles;
        let _ = EMPTY.with(|table| table.at(&Angles { theta_i, phi_i, theta_o, phi_o }.into()));
    }
}

thread_local! {
    static EMPTY: Merl = Merl::from_fn(|_| [f64::NAN; 3]);
}
