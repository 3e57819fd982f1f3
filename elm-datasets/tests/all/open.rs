//! The samples of pbrt-v2, and the door that finds a file's format out.

use std::fs;
use std::path::{Path, PathBuf};

use elm_datasets::geometry::NORMAL;
use elm_datasets::merl::Merl;
use elm_datasets::{Angles, Error, Format, Invalid, OpenOptions, Sampling, open, pbrt, scattered};
use ndarray::array;
use proptest::prelude::*;

const WHOLE: &str =
    "# clay\n2 # wavelengths\n450 650\n\n0.1 0.2 0.3 -3.0 0.25\n0.5\n1.5 0 0 0 1 -2e-3";

fn file(dir: &Path, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
    let path = dir.join(name);
    fs::write(&path, content).unwrap();
    path
}

#[test]
fn numbers_are_read_across_lines_and_comments() {
    let dir = tempfile::tempdir().unwrap();
    for text in [
        WHOLE.to_owned(),
        WHOLE.replace('\n', "\r\n"),
        WHOLE.replace('#', "\u{a}#\u{fc}"),
    ] {
        let samples = pbrt::read(file(dir.path(), "x.brdf", text)).unwrap();
        assert_eq!(samples.channels, ["450 nm", "650 nm"]);
        assert_eq!(samples.values, array![[0.25, 0.5], [1.0, -2e-3]]);
        let first = Angles::of(&samples.directions[0]);
        assert_eq!((first.theta_i, first.phi_i), (0.1, 0.2));
        assert_eq!((first.theta_o, first.phi_o), (0.3, -3.0));
    }
}

/// What is wrong, the text, and what the message must contain.
#[rustfmt::skip]
const DAMAGE: &[(&str, &str, &[&str])] = &[
    ("empty", "", &["more numbers, 1 at least"]),
    ("only a comment", "# 1\n", &["line 2", "1 at least"]),
    ("no wavelengths", "0 1 1 1 1", &["line 1", "at least 1", "found 0.0"]),
    ("negative count", "-1 400", &["line 1", "found -1.0"]),
    ("half a wavelength", "1.5 400", &["line 1", "found 1.5"]),
    ("more than the file can hold", "\n1e16 400", &["line 2", "found 1e16"]),
    ("wavelength zero", "2 400\n0 0 0 0 0 1 1", &["line 2", "above 0", "found 0"]),
    ("a word", "1 400\n0 0 O 0 1", &["line 2", "number 3", "\"O\""]),
    ("not a number", "1 400\n0 0 0 0 nan", &["line 2", "number 5", "\"nan\""]),
    ("commas", "1 400\n0,0,0,0,1", &["line 2", "number 1", "\"0,0,0,0,1\""]),
    ("no samples", "1 400\n", &[", 5 at least"]),
    ("wavelengths missing", "3 400 500", &[", 8 at least"]),
    ("angle missing", "1 400\n0 0 0 0 1\n0 0 0", &["line 3", ", 2 at least"]),
    ("value missing", "2 400 500\n0 0 0 0 1 2\n0 0 0 0 1", &["line 3", ", 1 at least"]),
    ("light below", "1 400\n0 0 0 0 1\n1.6 0 0 0 1", &["line 3", "theta_i", "pi/2", "1.6"]),
    ("viewer negative", "1 400\n0 0 -0.1 0 1", &["line 2", "theta_o", "-0.1"]),
];

#[test]
fn damage_is_reported_with_file_line_and_expectation() {
    let dir = tempfile::tempdir().unwrap();
    for (what, text, fragments) in DAMAGE {
        let Err(error) = pbrt::read(file(dir.path(), "x.brdf", text)) else {
            panic!("{what}: read without an error")
        };
        let message = error.to_string();
        for fragment in fragments.iter().chain(&["x.brdf"]) {
            assert!(
                message.contains(fragment),
                "{what}: no {fragment:?} in {message:?}"
            );
        }
        assert!(!message.contains('\n'), "{what}: {message}");
    }
    let error = pbrt::read(file(dir.path(), "x.brdf", b"1 400\n0 \xff")).unwrap_err();
    assert!(matches!(error, Error::NotUtf8 { line: 2, .. }), "{error}");
}

const CSV: &str = "Theta_i, phi_i,theta_o,phi_o,y\n1,0,0.5,3,-0.25\n0,0,0,0,1\n";

fn options(rows: usize) -> OpenOptions {
    OpenOptions {
        sampling: Sampling::Random { rows, seed: 1 },
        ..OpenOptions::default()
    }
}

#[test]
fn a_format_is_known_by_content_then_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let merl = dir.path().join("table");
    Merl::from_fn(|_| [0.5; 3]).write(&merl).unwrap();
    let ggx = crate::bsdf::Ggx {
        alpha: 0.5,
        facet: [1.0; 3],
    };
    for (path, format, rows) in [
        (merl, Format::Merl, 40),
        (file(dir.path(), "a.csv", CSV), Format::Scattered, 2),
        (file(dir.path(), "a.TXT", CSV), Format::Scattered, 2),
        (file(dir.path(), "a.BRDF", WHOLE), Format::Pbrt, 2),
        // A name that misleads.
        (
            file(dir.path(), "b.csv", ggx.file(&[0.1, 1.0], 5, 3)),
            Format::Rgl,
            40,
        ),
    ] {
        let opened = open(&path, &options(40)).unwrap();
        assert_eq!(opened.format, format);
        assert_eq!(opened.samples.directions.len() + opened.unmeasured, rows);
        assert_eq!(
            opened.samples.values.nrows(),
            opened.samples.directions.len()
        );
        assert!(opened.samples.values.iter().all(|&value| value >= 0.0));
    }
    let message = |name: &str, content: &[u8]| {
        let path = file(dir.path(), name, content);
        open(path, &options(40)).unwrap_err().to_string()
    };
    assert!(message("a.png", b"\x89PNG").contains(".csv"));
    assert!(message("empty", b"").contains(".bsdf"));
    assert!(message("a.bsdf", b"no").contains("tensor_file"));
    assert!(message("a.binary", b"no").contains("34992012 bytes"));
}

#[test]
fn a_file_without_end_is_refused_before_it_is_read() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["x.csv", "x.bsdf", "x.brdf", "x.binary"] {
        // A hole of a terabyte takes no room on the disk and must take none in memory.
        let path = file(dir.path(), name, "");
        fs::File::create(&path).unwrap().set_len(1 << 40).unwrap();
        let message = open(&path, &options(10)).unwrap_err().to_string();
        assert!(message.contains(name), "{message}");
        assert!(
            message.contains("1099511627776") || name == "x.binary",
            "{message}"
        );
    }
}

#[test]
fn a_format_can_be_named() {
    let dir = tempfile::tempdir().unwrap();
    let path = file(dir.path(), "samples", WHOLE);
    assert!(open(&path, &OpenOptions::default()).is_err());
    for format in Format::ALL {
        assert_eq!(
            format.to_string().to_uppercase().parse::<Format>().unwrap(),
            format
        );
    }
    let format = Some("pbrt".parse().unwrap());
    let named = OpenOptions {
        format,
        ..OpenOptions::default()
    };
    assert_eq!(open(&path, &named).unwrap().format, Format::Pbrt);
    let message = "exr".parse::<Format>().unwrap_err().to_string();
    assert!(
        message.contains("exr") && message.contains("merl"),
        "{message}"
    );
}

#[test]
fn negative_values_are_counted_and_treated_as_asked() {
    let dir = tempfile::tempdir().unwrap();
    let path = file(dir.path(), "a.csv", CSV);
    for (invalid, expected) in [
        (Invalid::Clamp, vec![0.0, 1.0]),
        (Invalid::Keep, vec![-0.25, 1.0]),
        (Invalid::Drop, vec![1.0]),
    ] {
        let options = OpenOptions {
            invalid,
            ..OpenOptions::default()
        };
        let opened = open(&path, &options).unwrap();
        assert_eq!(opened.invalid, 1);
        assert_eq!(opened.samples.values.column(0).to_vec(), expected);
        assert_eq!(opened.samples.directions.len(), expected.len());
        assert_eq!(opened.samples.directions.last().unwrap().incident, NORMAL);
    }
    let only = file(
        dir.path(),
        "b.csv",
        "theta_i,phi_i,theta_o,phi_o,y\n0,0,0,0,-1\n",
    );
    let drop = OpenOptions {
        invalid: Invalid::Drop,
        ..OpenOptions::default()
    };
    let error = open(only, &drop).unwrap_err();
    assert!(matches!(error, Error::NothingMeasured { .. }), "{error}");
}

#[test]
fn options_of_csv_files_are_passed_on() {
    let dir = tempfile::tempdir().unwrap();
    let path = file(
        dir.path(),
        "a.csv",
        "theta_i,phi_i,theta_o,phi_o,y\n60,0,30,0,1\n",
    );
    let options = OpenOptions {
        scattered: scattered::Options {
            unit: scattered::AngleUnit::Degrees,
            cosine_weighted: true,
        },
        ..OpenOptions::default()
    };
    let opened = open(path, &options).unwrap();
    assert!((opened.samples.values[[0, 0]] - 2.0).abs() < 1e-14);
}

proptest! {
    #[test]
    fn mutations_are_no_reason_to_panic(changes in crate::support::changes()) {
        let dir = tempfile::tempdir().unwrap();
        let path = file(dir.path(), "x.brdf", crate::support::mutate(WHOLE.into(), changes));
        match pbrt::read(&path) {
            Ok(samples) => {
                let shape = (samples.directions.len(), samples.channels.len());
                prop_assert_eq!(samples.values.dim(), shape);
            }
            Err(error) => prop_assert!(!error.to_string().contains('\n')),
        }
    }

    #[test]
    fn whatever_a_file_holds_opening_it_is_no_reason_to_panic(
        bytes in any::<Vec<u8>>(),
        name in prop::sample::select(vec!["x", "x.csv", "x.binary", "x.bsdf", "x.brdf"]),
    ) {
        let dir = tempfile::tempdir().unwrap();
        let _ = open(file(dir.path(), name, bytes), &options(10));
    }
}
