//! Scattered samples as CSV: what is accepted, what is refused and how, and that nothing panics.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, FRAC_PI_6, PI};
use std::fs;
use std::time::Instant;

use elm_datasets::scattered::{self, AngleUnit, Options, Problem};
use elm_datasets::{Angles, DirectionPair, Error, Samples};
use ndarray::{Array2, array};
use proptest::prelude::*;

const RADIANS: Options = Options {
    unit: AngleUnit::Radians,
    cosine_weighted: false,
};
const DEGREES: Options = Options {
    unit: AngleUnit::Degrees,
    cosine_weighted: false,
};
const WEIGHTED: Options = Options {
    unit: AngleUnit::Degrees,
    cosine_weighted: true,
};

fn parse(text: &str, options: &Options) -> Result<Samples, Error> {
    scattered::from_reader(text.as_bytes(), "some.csv", options)
}

fn pair([theta_i, phi_i, theta_o, phi_o]: [f64; 4]) -> DirectionPair {
    DirectionPair::from(Angles {
        theta_i,
        phi_i,
        theta_o,
        phi_o,
    })
}

#[track_caller]
fn close(found: &DirectionPair, expected: [f64; 4]) {
    let expected = pair(expected);
    let parts = |pair: &DirectionPair| [pair.incident, pair.outgoing].concat();
    for (found, expected) in parts(found).into_iter().zip(parts(&expected)) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
}

#[test]
fn columns_are_known_by_name_in_any_order_and_the_rest_are_channels() {
    let text = "550nm,phi_o,Theta_I,650nm,theta_o,PHI_I\n1,2,0.5,3,0.25,-4\n";
    let samples = parse(text, &RADIANS).unwrap();
    close(&samples.directions[0], [0.5, -4.0, 0.25, 2.0]);
    assert_eq!(samples.channels, ["550nm", "650nm"]);
    assert_eq!(samples.values, array![[1.0, 3.0]]);
}

#[test]
fn degrees_radians_and_vectors_say_the_same() {
    // sin 60 = root(3)/2, cos 60 = 1/2; the azimuths are 90 and 180 degrees.
    let root = 3.0_f64.sqrt() / 2.0;
    let expected = [FRAC_PI_3, FRAC_PI_2, FRAC_PI_6, PI];
    let angles = "theta_i,phi_i,theta_o,phi_o,y\n";
    let degrees = parse(&format!("{angles}60,90,30,180,1"), &DEGREES).unwrap();
    let [a, b, c, d] = expected;
    let radians = parse(&format!("{angles}{a},{b},{c},{d},1"), &RADIANS).unwrap();
    let text = format!("wo_x,wo_y,wo_z,wi_x,wi_y,wi_z,y\n-0.5,0,{root},0,{root},0.5,1");
    let vectors = parse(&text, &RADIANS).unwrap();
    for samples in [degrees, radians, vectors] {
        close(&samples.directions[0], expected);
        assert_eq!(samples.values, array![[1.0]]);
    }
}

#[test]
fn vectors_with_three_decimals_are_unit_vectors() {
    let text = "wi_x,wi_y,wi_z,wo_x,wo_y,wo_z,y\n0.577,0.577,0.577,0,0,1,1";
    let samples = parse(text, &RADIANS).unwrap();
    // The angle between the diagonal of a cube and an edge.
    let diagonal = 2.0_f64.sqrt().atan();
    assert!((Angles::of(&samples.directions[0]).theta_i - diagonal).abs() < 1e-12);
}

#[test]
fn cosine_weighted_values_are_divided_by_the_cosine_of_the_light() {
    let text = "theta_i,phi_i,theta_o,phi_o,r,g\n60,0,30,0,0.5,2\n0,0,30,0,0.5,2\n";
    let samples = parse(text, &WEIGHTED).unwrap();
    for (found, expected) in samples.values.iter().zip([1.0, 4.0, 0.5, 2.0]) {
        assert!((found - expected).abs() < 1e-14);
    }
}

/// What is wrong, the text, the options, and what the message must contain.
#[rustfmt::skip]
const DAMAGE: &[(&str, &str, Options, &[&str])] = &[
    ("empty", "", RADIANS, &["found nothing"]),
    ("no rows", "theta_i,phi_i,theta_o,phi_o,y\n", RADIANS, &["only a header"]),
    ("no header", "0.1,0,0.1,0,1\n", RADIANS, &["line 1", "names of the columns"]),
    ("no directions", "x,y\n1,2\n", RADIANS, &["line 1", "theta_i, phi_i", "wi_x", "missing theta_i, phi_i, theta_o, phi_o"]),
    ("an angle missing", "\ntheta_i,phi_i,phi_o,y\n1,2,3,4\n", RADIANS, &["line 2", "missing theta_o", "--angle theta_o="]),
    ("a part missing", "wi_x,wi_y,wi_z,wo_x,wo_z,y\n1,2,3,4,5,6\n", RADIANS, &["line 1", "missing wo_y"]),
    ("both sets", "theta_i,phi_i,theta_o,phi_o,wi_x,y\n0,0,0,0,0,1\n", RADIANS, &["line 1", "both"]),
    ("an angle in two spellings", "theta_i,phi_i,theta_o,phi_o,Phi_O,y\n0,0,0,0,0,1\n", RADIANS, &["line 1", "both"]),
    ("no values", "theta_i,phi_i,theta_o,phi_o\n0,0,0,0\n", RADIANS, &["line 1", "column of values"]),
    ("a cell missing", "theta_i,phi_i,theta_o,phi_o,y\n0,0,0,0,1\n0,0,0,0\n", RADIANS, &["line 3", "expected 5 numbers", "found 4"]),
    ("a word", "theta_i,phi_i,theta_o,phi_o,y\n0,0,0,0,dark\n", RADIANS, &["line 2", "column \"y\"", "\"dark\""]),
    ("not a number", "theta_i,phi_i,theta_o,phi_o,y\n0,0,NaN,0,1\n", RADIANS, &["line 2", "column \"theta_o\"", "\"NaN\""]),
    ("light below", "theta_i,phi_i,theta_o,phi_o,y\r\n0,0,0,0,1\r\n\r\n1.58,0,0,0,1\r\n", RADIANS, &["line 4", "theta_i", "pi/2 radians", "1.58"]),
    ("viewer below", "theta_i,phi_i,theta_o,phi_o,y\n0,0,90.5,0,1\n", DEGREES, &["line 2", "theta_o", "90 degrees", "90.5"]),
    ("negative angle below", "theta_i,phi_i,theta_o,phi_o,y\n-1.6,0,0,0,1\n", RADIANS, &["line 2", "theta_i", "-1.6"]),
    ("long vector", "wi_x,wi_y,wi_z,wo_x,wo_y,wo_z,y\n0,0,1,0,0,1,1\n0,0,1,1,0,1,1\n", RADIANS, &["line 3", "wo", "unit vector", "1.41"]),
    ("no vector", "wi_x,wi_y,wi_z,wo_x,wo_y,wo_z,y\n0,0,0,0,0,1,1\n", RADIANS, &["line 2", "wi", "length 0"]),
    ("vector below", "wi_x,wi_y,wi_z,wo_x,wo_y,wo_z,y\n0,0,1,0,0,-1,1\n", RADIANS, &["line 2", "wo above", "-1"]),
    ("light at the horizon", "theta_i,phi_i,theta_o,phi_o,y\n90,0,0,0,1\n", WEIGHTED, &["line 2", "above the horizon", "cos theta_i"]),
];

#[test]
fn damage_is_reported_with_file_line_and_expectation() {
    for (what, text, options, fragments) in DAMAGE {
        let Err(error) = parse(text, options) else {
            panic!("{what}: read without an error")
        };
        let message = error.to_string();
        for fragment in fragments.iter().chain(&["some.csv"]) {
            assert!(
                message.contains(fragment),
                "{what}: no {fragment:?} in {message:?}"
            );
        }
        assert!(!message.contains('\n'), "{what}: {message}");
    }
}

#[test]
fn the_horizon_itself_is_a_direction() {
    let text = "theta_i,phi_i,theta_o,phi_o,y\n90,0,90,180,0\n";
    let samples = parse(text, &DEGREES).unwrap();
    close(&samples.directions[0], [FRAC_PI_2, 0.0, FRAC_PI_2, PI]);
}

fn one(angles: [f64; 4], value: f64, channel: &str) -> Samples {
    Samples {
        directions: vec![pair(angles)],
        values: array![[value]],
        channels: vec![channel.to_owned()],
    }
}

#[test]
fn samples_that_would_not_be_read_back_are_not_written() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.csv");
    let good = one([0.1, 0.2, 0.3, 0.4], 1.0, "y");
    let mut short = good.clone();
    short.directions.clear();
    let mut nameless = good.clone();
    nameless.channels.clear();
    let empty = Samples {
        directions: Vec::new(),
        values: Array2::zeros((0, 1)),
        channels: vec!["y".to_owned()],
    };
    let name = "Theta_i";
    for (samples, expected) in [
        (short, "0 directions"),
        (nameless, "0 names"),
        (empty, "column of values"),
        (one([0.0; 4], 1.0, name), "\"Theta_i\""),
        (one([0.0; 4], 1.0, ""), "name of its own"),
        (one([0.0; 4], 1.0, " y"), "\" y\""),
        (one([0.0; 4], f64::NAN, "y"), "column \"y\""),
        (one([0.5, f64::INFINITY, 0.0, 0.0], 1.0, "y"), "\"theta_i\""),
        (
            one([1.6, 0.0, 0.0, 0.0], 1.0, "y"),
            "line 2: expected theta_i",
        ),
    ] {
        let message = scattered::write(&path, &samples).unwrap_err().to_string();
        assert!(message.contains(expected), "{expected}: {message}");
    }
    assert!(!path.exists());
    scattered::write(&path, &good).unwrap();
    assert_eq!(scattered::read(&path, &RADIANS).unwrap(), good);
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
}

#[test]
#[ignore = "needs data: rgl"]
fn real_rgb_samples_are_read_whole_and_fast() {
    for material in ["cc_iris_purple_gem", "paper_white", "vch_golden_yellow"] {
        for (part, rows) in [("train", 20_000), ("test", 6_000)] {
            let name = format!("{material}_rgb_{part}.csv");
            let Some(path) = elm_test_support::folder("rgl").map(|dir| dir.join(&name)) else {
                return;
            };
            let start = Instant::now();
            let samples = scattered::read(&path, &RADIANS).unwrap();
            eprintln!("{name}: {:?}", start.elapsed());
            assert_eq!(samples.channels, ["r", "g", "b"]);
            assert_eq!(samples.values.dim(), (rows, 3));
            assert!(samples.values.iter().all(|&value| value >= 0.0));
        }
    }
}

#[test]
fn a_place_is_a_value_to_match_on() {
    let error = parse("theta_i,phi_i,theta_o,phi_o,y\n2,0,0,0,1\n", &RADIANS).unwrap_err();
    assert!(matches!(
        error,
        Error::Scattered {
            line: 2,
            problem: Problem::PolarAngle {
                angle: "theta_i",
                unit: AngleUnit::Radians,
                ..
            },
            ..
        }
    ));
}

proptest! {
    #[test]
    fn what_is_written_is_read_back_bit_for_bit(
        rows in prop::collection::vec(
            ((0.0..=FRAC_PI_2, -PI..=PI), (0.0..=FRAC_PI_2, -3..=3_i8), -1e300..1e300), 1..20),
        name in "[a-z ,\"\n]{1,8}x",
    ) {
        let samples = Samples {
            directions: rows.iter().map(|&((theta_i, phi_i), (theta_o, phi_o), _)| {
                pair([theta_i, phi_i, theta_o, f64::from(phi_o)])
            }).collect(),
            values: Array2::from_shape_fn((rows.len(), 1), |(row, _)| rows[row].2),
            channels: vec![name.trim_start().to_owned()],
        };
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.csv");
        scattered::write(&path, &samples).unwrap();
        prop_assert_eq!(scattered::read(&path, &RADIANS).unwrap(), samples);
    }
}
