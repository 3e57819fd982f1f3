//! Tables as measuring people have them: other separators, names, units and quantities.

use std::f64::consts::PI;
use std::fs;
use std::io::Write as _;
use std::path::Path;

use elm_datasets::{Error, OpenOptions, Opened, open, scattered};
use flate2::Compression;
use flate2::write::GzEncoder;

/// The table that all others are.
const PLAIN: &str =
    "theta_i,phi_i,theta_o,phi_o,brdf\n60,0,30,180,0.25\n10,0,45,90,1.5e-1\n0,0,70,-20,0.125\n";

fn read(
    dir: &Path,
    name: &str,
    text: impl AsRef<[u8]>,
    options: &OpenOptions,
) -> Result<Opened, Error> {
    let path = dir.join(name);
    fs::write(&path, text).unwrap();
    open(&path, options)
}

fn degrees() -> OpenOptions {
    OpenOptions {
        scattered: scattered::Options {
            unit: scattered::AngleUnit::Degrees,
            ..scattered::Options::default()
        },
        ..OpenOptions::default()
    }
}

/// The name of a file, its text, and what the notes must say.
#[rustfmt::skip]
const SAME: &[(&str, &str, &[&str])] = &[
    ("tabs.tsv", "theta_i\tphi_i\ttheta_o\tphi_o\tbrdf\n60\t0\t30\t180\t0.25\n10\t0\t45\t90\t1.5e-1\n0\t0\t70\t-20\t0.125\n", &["tabs"]),
    ("commas.csv", "theta_i;phi_i;theta_o;phi_o;brdf\n60,0;0;30;180;0,25\n10;0;45;90;1,5e-1\n0;0;70;-20;0,125\n", &["semicolons", "commas for points"]),
    ("blanks.txt", "  theta_i phi_i  theta_o phi_o brdf \n 60 0 30 180 0.25\n10  0 45  90 1.5e-1 \n0 0 70 -20 0.125\n", &["blanks"]),
    ("numpy.dat", "# theta_i phi_i theta_o phi_o brdf\n60 0 30 180 0.25\n10 0 45 90 1.5e-1\n0 0 70 -20 0.125\n", &["blanks"]),
    ("comments.csv", "# a paint\r\n# by hand; see the notes, too\r\ntheta_i,phi_i,theta_o,phi_o,brdf\r\n60,0,30,180,0.25\r\n# in between\r\n10,0,45,90,1.5e-1\r\n0,0,70,-20,0.125\r\n", &["3 lines of comments"]),
    ("preamble.csv", "Instrument: ours\nOperator: nobody\n\ntheta_i,phi_i,theta_o,phi_o,brdf\n60,0,30,180,0.25\n10,0,45,90,1.5e-1\n0,0,70,-20,0.125\n", &["2 lines of comments"]),
    ("names.csv", "thi,phi_in,Theta_s,phi_s,brdf\n60,0,30,180,0.25\n10,0,45,90,1.5e-1\n0,0,70,-20,0.125\n", &["thi as theta_i", "Theta_s as theta_o"]),
    ("view.csv", "SZA,SAA,VZA,VAA,brdf\n60,0,30,180,0.25\n10,0,45,90,1.5e-1\n0,0,70,-20,0.125\n", &["SZA as theta_i"]),
    ("sun.csv", "theta_s,phi_s,theta_v,phi_v,brdf\n60,0,30,180,0.25\n10,0,45,90,1.5e-1\n0,0,70,-20,0.125\n", &["theta_s as theta_i"]),
    ("difference.csv", "theta_i,theta_r,dphi,brdf\n60,30,180,0.25\n10,45,90,1.5e-1\n0,70,-20,0.125\n", &["dphi is taken as phi_o - phi_i"]),
    ("no_light.csv", "theta_i,theta_o,phi_o,brdf\n60,30,180,0.25\n10,45,90,1.5e-1\n0,70,-20,0.125\n", &["no column of phi_i"]),
];

#[test]
fn the_same_table_is_read_in_every_dialect() {
    let dir = tempfile::tempdir().unwrap();
    let expected = read(dir.path(), "plain.csv", PLAIN, &degrees()).unwrap();
    assert!(expected.notes.is_empty(), "{:?}", expected.notes);
    for (name, text, notes) in SAME {
        let found = read(dir.path(), name, text, &degrees()).unwrap();
        assert_eq!(found.samples, expected.samples, "{name}");
        let said: Vec<String> = found.notes.iter().map(ToString::to_string).collect();
        for note in *notes {
            assert!(said.iter().any(|s| s.contains(note)), "{name}: {said:?}");
        }
    }
}

#[test]
fn a_compressed_file_is_what_it_holds() {
    let dir = tempfile::tempdir().unwrap();
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(PLAIN.as_bytes()).unwrap();
    let bytes = encoder.finish().unwrap();
    let expected = read(dir.path(), "plain.csv", PLAIN, &degrees()).unwrap();
    for name in ["paint.csv.gz", "paint.gz", "paint.csv"] {
        let found = read(dir.path(), name, &bytes, &degrees()).unwrap();
        assert_eq!(found.samples, expected.samples, "{name}");
    }
    let half = read(
        dir.path(),
        "half.csv.gz",
        &bytes[..bytes.len() / 2],
        &degrees(),
    );
    let message = half.unwrap_err().to_string();
    assert!(
        message.starts_with("cannot read") && message.contains("half.csv.gz"),
        "{message}"
    );
}

#[test]
fn units_are_taken_from_names_and_from_comments_that_angles_bear_out() {
    let dir = tempfile::tempdir().unwrap();
    let expected = read(dir.path(), "plain.csv", PLAIN, &degrees()).unwrap();
    let rows = "60,0,30,180,0.25\n10,0,45,90,1.5e-1\n0,0,70,-20,0.125\n";
    for (header, place) in [
        (
            "theta_i (deg),phi_i (deg),theta_o [deg],phi_o_deg,brdf\n",
            "names say",
        ),
        (
            "# angles in degrees\ntheta_i,phi_i,theta_o,phi_o,brdf\n",
            "comments say",
        ),
    ] {
        let text = format!("{header}{rows}");
        let found = read(dir.path(), "a.csv", text, &OpenOptions::default()).unwrap();
        assert_eq!(found.samples, expected.samples, "{header}");
        let said: Vec<String> = found.notes.iter().map(ToString::to_string).collect();
        assert!(said.iter().any(|s| s.contains(place)), "{said:?}");
    }
    // Of something else.
    let text = "# at 23 degrees Celsius\ntheta_i,phi_i,theta_o,phi_o,brdf\n1,0,0.5,3,0.25\n";
    let found = read(dir.path(), "a.csv", text, &OpenOptions::default()).unwrap();
    assert!((found.samples.directions[0].incident[2] - 1.0_f64.cos()).abs() < 1e-15);
}

#[test]
fn reflectance_factors_are_divided_by_pi() {
    let dir = tempfile::tempdir().unwrap();
    let expected = read(dir.path(), "plain.csv", PLAIN, &degrees()).unwrap();
    for header in ["BRF", "reflectance factor", "value"] {
        let text = PLAIN.replace(",brdf", &format!(",{header}"));
        let mut options = degrees();
        options.columns.reflectance_factor = header == "value";
        let found = read(dir.path(), "a.csv", text, &options).unwrap();
        assert_eq!(
            found.samples.values,
            &expected.samples.values / PI,
            "{header}"
        );
    }
}

#[test]
fn channels_of_reflectance_factors_keep_names_of_their_own() {
    let dir = tempfile::tempdir().unwrap();
    let text =
        "theta_i,phi_i,theta_o,phi_o,BRF (2),HDRF,HCRF,BRF 550nm hcrf\n10,0,20,180,1,2,3,4\n";
    let found = read(dir.path(), "a.csv", text, &degrees()).unwrap();
    let expected = ["brdf (2)", "brdf", "brdf (3)", "brdf 550nm brdf"];
    assert_eq!(found.samples.channels, expected);
}

#[test]
fn an_angle_that_no_direction_needs_is_no_value() {
    let dir = tempfile::tempdir().unwrap();
    for header in [
        "theta_i,phi_i,theta_o,phi_o,dphi\n10,0,20,180,180\n",
        "theta_i,phi_i,theta_o,phi_o,data,dphi\n10,0,20,180,0.1,180\n",
        "wi_x,wi_y,wi_z,wo_x,wo_y,wo_z,relative azimuth\n0,0,1,0,0,1,0\n",
    ] {
        let message = read(dir.path(), "a.csv", header, &degrees()).unwrap_err();
        let message = message.to_string();
        assert!(
            message.contains("dphi") || message.contains("relative"),
            "{message}"
        );
    }
}

#[test]
fn an_angle_that_is_no_column_can_be_given() {
    let dir = tempfile::tempdir().unwrap();
    let text = "theta_o,phi_o,brdf\n30,180,0.25\n45,90,0.5\n";
    let mut options = degrees();
    let message = read(dir.path(), "a.csv", text, &options)
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("missing theta_i") && message.contains("--angle theta_i="),
        "{message}"
    );
    options.columns.angles[0] = Some(60.0);
    let found = read(dir.path(), "a.csv", text, &options).unwrap();
    for pair in &found.samples.directions {
        assert!((pair.incident[2] - 0.5).abs() < 1e-15);
    }
    // It says of which side a column is whose name does not.
    let either = text.replace("theta_o,phi_o", "theta_s,phi_s");
    let same = read(dir.path(), "b.csv", either, &options).unwrap();
    assert_eq!(same.samples, found.samples);
    let mut of_viewer = degrees();
    of_viewer.columns.angles[2] = Some(60.0);
    let light = read(dir.path(), "c.csv", "theta_s,brdf\n30,0.25\n", &of_viewer).unwrap();
    let incident = light.samples.directions[0].incident;
    assert!((incident[2] - 30.0_f64.to_radians().cos()).abs() < 1e-15);
    options.columns.angles[2] = Some(10.0);
    let message = read(dir.path(), "a.csv", text, &options)
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("theta_o is given for all rows"),
        "{message}"
    );
}

/// The header, and what the message must contain.
#[rustfmt::skip]
const UNCLEAR: &[(&str, &[&str])] = &[
    ("theta_s,phi_s,brdf,theta_s2", &["theta_s", "light or of the viewer"]),
    ("theta_i,theta_in,theta_o,brdf", &["theta_in", "both theta_i", "--ignore"]),
    ("theta_i (deg),phi_i,theta_o (rad),brdf", &["degrees and radians"]),
    ("wi_x,theta_i,phi_i,brdf", &["both"]),
];

#[test]
fn what_is_unclear_is_one_line_that_says_what_to_do() {
    let dir = tempfile::tempdir().unwrap();
    for (header, fragments) in UNCLEAR {
        let text = format!("{header}\n0.1,0.2,0.3,0.4\n");
        let message = read(dir.path(), "a.csv", text, &OpenOptions::default())
            .unwrap_err()
            .to_string();
        for fragment in *fragments {
            assert!(message.contains(fragment), "{header}: {message}");
        }
        assert!(
            !message.contains('\n') && message.contains("line 1"),
            "{message}"
        );
    }
}
