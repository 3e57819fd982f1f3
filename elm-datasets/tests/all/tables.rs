//! Tables as people who measure have them, read by the one door: columns that are no channels, a row
//! per wavelength, rounding at the horizon, signed angles, transmitted rows, missing values.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fs;

use elm_datasets::scattered::{self, AngleUnit, Columns};
use elm_datasets::{Angles, Invalid, OpenOptions, Opened, open};
use ndarray::array;

fn read(name: &str, text: &str, options: &OpenOptions) -> Result<Opened, String> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    fs::write(&path, text).unwrap();
    open(&path, options).map_err(|error| error.to_string())
}

fn degrees() -> OpenOptions {
    OpenOptions {
        scattered: scattered::Options {
            unit: AngleUnit::Degrees,
            ..scattered::Options::default()
        },
        ..OpenOptions::default()
    }
}

fn with(channels: &[&str], ignore: &[&str]) -> OpenOptions {
    let list = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
    OpenOptions {
        columns: Columns {
            channels: list(channels),
            ignore: list(ignore),
            ..Columns::default()
        },
        ..degrees()
    }
}

const ANGLES: &str = "theta_i,phi_i,theta_o,phi_o";

#[test]
fn columns_that_say_something_else_are_no_channels_until_someone_says_so() {
    for extra in [
        "brdf_std",
        "row",
        "u(brdf)",
        "Sample No",
        "time_s",
        "note",
        "deviation",
    ] {
        let text = format!("{ANGLES},brdf,{extra}\n10,0,20,180,0.3,7\n");
        let error = read("a.csv", &text, &degrees()).unwrap_err();
        assert!(
            error.contains(extra) && error.contains("--ignore") && error.contains("--channels"),
            "{extra}: {error}"
        );
        for options in [with(&[], &[extra]), with(&["brdf"], &[])] {
            let opened = read("a.csv", &text, &options).unwrap();
            assert_eq!(opened.samples.channels, ["brdf"], "{extra}");
            assert_eq!(opened.samples.values, array![[0.3]]);
        }
    }
    // What is left out may hold anything.
    let text = format!("{ANGLES},brdf,operator\n10,0,20,180,0.3,Ann\n");
    assert!(read("a.csv", &text, &with(&["brdf"], &[])).is_ok());
    let error = read("a.csv", &text, &with(&["red"], &[])).unwrap_err();
    assert!(
        error.contains("\"red\"") && error.contains("brdf"),
        "{error}"
    );
    // A single column needs no name that is known, and names of which none is known are one kind.
    for names in [
        "paint",
        "felt,velvet",
        "450,550,650",
        "R,G,B",
        "0.45 um,0.55 um",
    ] {
        let values = vec!["0.1"; names.split(',').count()].join(",");
        let text = format!("{ANGLES},{names}\n10,0,20,180,{values}\n");
        assert!(read("a.csv", &text, &degrees()).is_ok(), "{names}");
    }
}

#[test]
fn channels_are_chosen_by_color_and_wavelength_in_the_order_asked_for() {
    let text = format!("{ANGLES},450 nm,550 nm,650 nm\n10,0,20,180,1,2,3\n");
    let opened = read("a.csv", &text, &with(&["650nm", "0.45 um"], &[])).unwrap();
    assert_eq!(opened.samples.values, array![[3.0, 1.0]]);
    let text = "3 450 550 650\n0.1 0 0.2 3 1 2 3\n";
    let opened = read("a.brdf", text, &with(&["550"], &[])).unwrap();
    assert_eq!(opened.samples.channels, ["550 nm"]);
    assert_eq!(opened.samples.values, array![[2.0]]);
    let error = read("a.brdf", text, &with(&["700"], &[])).unwrap_err();
    assert!(
        error.contains("\"700\"") && error.contains("450 nm"),
        "{error}"
    );
}

#[test]
fn a_row_per_wavelength_becomes_a_channel_per_wavelength() {
    for (name, values) in [
        ("wavelength_nm", ["650", "450"]),
        ("lambda", ["650", "450"]),
        ("Wavelength (um)", ["0.65", "0.45"]),
    ] {
        let mut text = format!("{ANGLES},{name},brdf\n");
        for (number, value) in values.iter().enumerate() {
            for theta in [10, 30] {
                text += &format!("{theta},0,20,180,{value},0.{number}{theta}\n");
            }
        }
        let opened = read("a.csv", &text, &degrees()).unwrap();
        assert_eq!(opened.samples.channels, ["450 nm", "650 nm"], "{name}");
        assert_eq!(opened.samples.values, array![[0.11, 0.01], [0.13, 0.03]]);
        assert_eq!(opened.samples.directions.len(), 2);
        assert_eq!(opened.notes.len(), 1, "{:?}", opened.notes);
        // One wavelength of them.
        let red = read("a.csv", &text, &with(&["brdf", "650"], &[])).unwrap();
        assert_eq!(red.samples.values, array![[0.01], [0.03]]);
    }
    // A column has one unit.
    let text = format!("{ANGLES},lambda,brdf\n10,0,20,0,0.5,1\n10,0,20,0,1.0,2\n10,0,20,0,2,3\n");
    let opened = read("a.csv", &text, &degrees()).unwrap();
    assert_eq!(opened.samples.channels, ["500 nm", "1000 nm", "2000 nm"]);
    // A pair that lacks a wavelength is left out and counted; a table without one is refused.
    let text = format!("{ANGLES},lambda,brdf\n10,0,20,0,450,1\n10,0,20,0,650,2\n30,0,20,0,450,3\n");
    let opened = read("a.csv", &text, &degrees()).unwrap();
    assert_eq!((opened.missing, opened.left_out), (1, 1));
    let text = format!("{ANGLES},lambda,brdf,brdf_2\n10,0,20,0,450,1,1\n");
    let error = read("a.csv", &text, &degrees()).unwrap_err();
    assert!(error.contains("--channels"), "{error}");
}

#[test]
fn angles_that_look_like_the_other_unit_are_told() {
    let radians = format!("{ANGLES},brdf\n0,0,0.5236,3.14159,0.3\n1.3963,0,1.0472,1.0472,0.3\n");
    let error = read("a.csv", &radians, &degrees()).unwrap_err();
    assert!(
        error.contains("--degrees") && error.contains("radians"),
        "{error}"
    );
    let text = format!("{ANGLES},brdf\n0,0,0,60,0.3\n20,0,60,180,0.3\n");
    let error = read("a.csv", &text, &OpenOptions::default()).unwrap_err();
    assert!(
        error.contains("line 3") && error.contains("--degrees"),
        "{error}"
    );
    // Azimuths alone are no proof.
    let text = format!("{ANGLES},brdf\n0,0,1,90,0.3\n1,0,1,180,0.3\n");
    let notes = read("a.csv", &text, &OpenOptions::default()).unwrap().notes;
    assert!(notes[0].to_string().contains("--degrees"), "{notes:?}");
    let text = format!("{ANGLES},brdf\n0,0,-1,0,0.3\n1,0,1,0,0.3\n");
    let notes = read("a.csv", &text, &degrees()).unwrap().notes;
    assert!(notes[0].to_string().contains("--degrees"), "{notes:?}");
}

#[test]
fn a_rounding_below_the_horizon_is_on_it_and_more_is_not() {
    for (text, within) in [
        (format!("{ANGLES},y\n1.5708,0,0,0,1\n"), true),
        (format!("{ANGLES},y\n0.3,0,1.571,0,1\n"), true),
        (format!("{ANGLES},y\n0.3,0,1.58,0,1\n"), false),
    ] {
        let found = read("a.csv", &text, &OpenOptions::default());
        assert_eq!(found.is_ok(), within, "{text}");
        if let Ok(opened) = found {
            let pair = Angles::of(&opened.samples.directions[0]);
            assert_eq!(pair.theta_i.max(pair.theta_o), FRAC_PI_2);
            assert_eq!(opened.notes.len(), 1);
        }
    }
    let vectors = "wi_x,wi_y,wi_z,wo_x,wo_y,wo_z,y\n";
    for (z, within) in [("-4.4e-8", true), ("-0.0004", true), ("-0.01", false)] {
        let text = format!("{vectors}0,0,1,1,0,{z},0.2\n");
        let found = read("a.csv", &text, &OpenOptions::default());
        assert_eq!(found.is_ok(), within, "{z}");
    }
    let found = read("a.brdf", "1 550\n0 0 1.5708 0 0.1", &OpenOptions::default()).unwrap();
    assert_eq!(Angles::of(&found.samples.directions[0]).theta_o, FRAC_PI_2);
}

#[test]
fn a_negative_polar_angle_is_on_the_other_side() {
    let text = format!("{ANGLES},y\n15,0,-80,0,1\n-15,90,80,0,1\n");
    let opened = read("a.csv", &text, &degrees()).unwrap();
    let [first, second] = [0, 1].map(|row: usize| Angles::of(&opened.samples.directions[row]));
    assert!((first.theta_o - 80_f64.to_radians()).abs() < 1e-15);
    assert_eq!(first.phi_o, PI);
    assert!((second.phi_i + 0.5 * PI).abs() < 1e-15);
    assert!(opened.notes[0].to_string().contains("2 polar angles"));
}

#[test]
fn transmitted_rows_are_left_out_and_counted() {
    let text = format!("{ANGLES},y\n15,0,80,0,1\n15,0,100,0,2\n15,0,180,0,3\n15,0,-170,0,4\n");
    let opened = read("a.csv", &text, &degrees()).unwrap();
    assert_eq!(opened.samples.values, array![[1.0]]);
    assert!(
        opened.notes[0].to_string().contains("3 rows"),
        "{:?}",
        opened.notes
    );
    let text = "wi_x,wi_y,wi_z,wo_x,wo_y,wo_z,y\n0,0,1,0,0,-1,2\n0,0,1,0,0,1,1\n";
    let opened = read("a.csv", text, &OpenOptions::default()).unwrap();
    assert_eq!(opened.samples.values, array![[1.0]]);
    // Light from below is no reflectance of this side, and neither are rows that all transmit.
    for text in [
        format!("{ANGLES},y\n15,0,80,0,1\n100,0,80,0,2\n"),
        format!("{ANGLES},y\n15,0,100,0,1\n"),
        format!("{ANGLES},y\n15,0,80,0,1\n15,0,200,0,2\n"),
    ] {
        assert!(read("a.csv", &text, &degrees()).is_err(), "{text}");
    }
}

#[test]
fn values_may_be_divided_by_the_cosine_of_the_scatter_angle() {
    let text = format!("{ANGLES},y\n0,0,60,0,0.5\n80,0,0,0,0.5\n");
    let mut options = degrees();
    options.columns.scatter_cosine = true;
    let opened = read("a.csv", &text, &options).unwrap();
    assert!((opened.samples.values[[0, 0]] - 1.0).abs() < 1e-14);
    assert!((opened.samples.values[[1, 0]] - 0.5).abs() < 1e-14);
}

#[test]
fn missing_values_are_left_out_and_counted_whatever_stands_for_them() {
    for fill in ["-999", "-9999.0", "-1", "-1e30"] {
        let mut text = format!("{ANGLES},r,g\n");
        for (theta, value) in [
            (10, "0.1"),
            (20, fill),
            (30, "0.3"),
            (40, fill),
            (50, "-0.002"),
        ] {
            text += &format!("{theta},0,20,180,{value},0.2\n");
        }
        text += "60,0,20,180,NaN,0.2\n70,0,20,180,,0.2\n";
        let opened = read("a.csv", &text, &degrees()).unwrap();
        assert_eq!(
            (opened.missing, opened.left_out, opened.invalid),
            (4, 4, 1),
            "{fill}"
        );
        assert_eq!(opened.fills, [fill.parse::<f64>().unwrap()]);
        assert_eq!(
            opened.samples.values,
            array![[0.1, 0.2], [0.3, 0.2], [0.0, 0.2]]
        );
        let kept = OpenOptions {
            invalid: Invalid::Keep,
            ..degrees()
        };
        let opened = read("a.csv", &text, &kept).unwrap();
        assert_eq!(
            (opened.missing, opened.left_out, opened.invalid),
            (2, 2, 3),
            "{fill}"
        );
    }
    let error = read("a.csv", &format!("{ANGLES},y\n10,0,NaN,0,1\n"), &degrees()).unwrap_err();
    assert!(error.contains("theta_o"), "{error}");
    let opened = read(
        "a.brdf",
        "1 550\n0 0 0 0 nan 0 0 0.1 0 2",
        &OpenOptions::default(),
    )
    .unwrap();
    assert_eq!((opened.missing, opened.samples.values), (1, array![[2.0]]));
}

#[test]
fn noise_that_was_rounded_is_no_fill_value() {
    // Around 1e-3 with two digits: values recur, as small as the noise.
    let mut text = format!("{ANGLES},y\n");
    for value in [
        "0.001", "-0.001", "0.002", "-0.001", "0.003", "-0.002", "-0.002", "0.001",
    ] {
        text += &format!("10,0,20,180,{value}\n");
    }
    let opened = read("a.csv", &text, &degrees()).unwrap();
    assert_eq!((opened.missing, opened.invalid), (0, 4));
}

#[test]
fn text_of_other_programs_is_called_what_it_is() {
    let zemax = "#own numbers\nSource  Measured\nSymmetry  PlaneSymmetrical\n\
                 SpectralContent  Monochrome\nScatterType  BRDF\nSampleRotation  1\n0\n\
                 AngleOfIncidence  2\n0 40\n";
    let window = "<?xml version=\"1.0\"?>\n<WindowElement xmlns=\"x\">\n</WindowElement>\n";
    for (name, text, word) in [
        ("a.bsdf", zemax, "Zemax"),
        ("a.bsdf", window, "Radiance"),
        ("a.xml", window, "Radiance"),
        ("a.bsdf", "#?RADIANCE\nFORMAT=x\n", "Radiance"),
        ("a.bsdf", "no format at all\n", "tensor_file"),
    ] {
        let error = read(name, text, &OpenOptions::default()).unwrap_err();
        assert!(error.contains(word) && error.contains(name), "{error}");
        assert!(!error.contains('\n'), "{error}");
    }
}
