//! `elm-brdf predict` and `elm-brdf info` as a user runs them.

use std::fs;
use std::path::{Path, PathBuf};

use crate::support::Program;
use elm_brdf::model::BrdfModel;
use elm_datasets::geometry::{DirectionPair, cartesian};
use elm_datasets::{Angles, Brdf, Invalid, MaterialId, Samples, scattered, synthetic};
use ndarray::Axis;

/// A model of two channels in a folder, fitted by the program.
fn model(program: &Program, dir: &Path) -> PathBuf {
    let data = synthetic::measurements(1, &[MaterialId::new(39).unwrap()], Invalid::Clamp);
    let all = data.samples(0).unwrap();
    let samples = Samples {
        values: all.values.select(Axis(1), &[0, 1]),
        channels: vec!["red".into(), "450 nm".into()],
        directions: all.directions,
    };
    scattered::write(dir.join("paint.csv"), &samples).unwrap();
    let (paint, model) = (dir.join("paint.csv"), dir.join("paint.elm"));
    let fit = [
        "fit",
        paint.to_str().unwrap(),
        "-o",
        model.to_str().unwrap(),
    ];
    program.output(&[&fit[..], &["--neurons", "30"]].concat());
    model
}

#[test]
fn values_stand_beside_the_directions_as_they_were_given_and_are_the_models_own() {
    let (program, dir) = (Program::new(), tempfile::tempdir().unwrap());
    let model = model(&program, dir.path());
    let own: BrdfModel = elm::persist::load(&model).unwrap();
    let asked = dir.path().join("asked.csv");
    // Degrees by the names, another order of columns, a column that is no direction, a tab between.
    let text = "# a sweep\nname\tTheta_o (deg)\ttheta_i (deg)\tphi_i (deg)\tphi_o (deg)\n\
                a\t10.50\t30\t0\t180\nb\t80\t+5e1\t0\t0\nc\t120\t20\t0\t0\n";
    fs::write(&asked, text).unwrap();
    let command = ["predict", model.to_str().unwrap(), asked.to_str().unwrap()];
    let assert = program.command().args(command).assert().success();
    let said = String::from_utf8(assert.get_output().stdout.clone()).unwrap();
    let notes = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
    assert!(
        notes.contains("1 rows have the viewer below the surface"),
        "{notes}"
    );
    let pair = |theta_i: f64, theta_o: f64, phi_o: f64| DirectionPair {
        incident: cartesian(theta_i.to_radians(), 0.0),
        outgoing: cartesian(theta_o.to_radians(), phi_o.to_radians()),
    };
    let values = own
        .eval(&[pair(30.0, 10.5, 180.0), pair(50.0, 80.0, 0.0)])
        .unwrap();
    let mut lines = said.lines();
    assert_eq!(
        lines.next(),
        Some("Theta_o (deg),theta_i (deg),phi_i (deg),phi_o (deg),red,450 nm")
    );
    for (start, values) in ["10.50,30,0,180,", "80,+5e1,0,0,"]
        .iter()
        .zip(values.rows())
    {
        let line = lines.next().unwrap();
        let numbers = line.strip_prefix(start).unwrap();
        let numbers: Vec<f64> = numbers.split(',').map(|n| n.parse().unwrap()).collect();
        for (found, value) in numbers.iter().zip(values) {
            assert!((found - value).abs() <= 1e-12 * value, "{line}: {value}");
        }
    }
    assert_eq!(lines.next(), Some("120,20,0,0,0.0,0.0"));
    assert_eq!(lines.next(), None);
}

#[test]
fn directions_that_were_measured_come_back_in_order_from_a_pipe_and_into_a_file() {
    let (program, dir) = (Program::new(), tempfile::tempdir().unwrap());
    let model = model(&program, dir.path());
    let (paint, out) = (dir.path().join("paint.csv"), dir.path().join("out.csv"));
    let command = [
        "predict",
        model.to_str().unwrap(),
        "-",
        "-o",
        out.to_str().unwrap(),
    ];
    let mut piped = program.command();
    piped.args(command).write_stdin(fs::read(&paint).unwrap());
    piped.assert().success().stdout("");
    let (measured, predicted) = (
        scattered::read(&paint, &scattered::Options::default()).unwrap(),
        scattered::read(&out, &scattered::Options::default()).unwrap(),
    );
    assert_eq!(measured.directions, predicted.directions);
    let own: BrdfModel = elm::persist::load(&model).unwrap();
    assert_eq!(predicted.values, own.eval(&measured.directions).unwrap());
    assert_eq!(predicted.channels, ["red", "450 nm"]);
}

#[test]
fn what_cannot_be_predicted_is_one_line_and_leaves_no_file() {
    let (program, dir) = (Program::new(), tempfile::tempdir().unwrap());
    let model = model(&program, dir.path());
    let (asked, out) = (dir.path().join("asked.csv"), dir.path().join("out.csv"));
    for (text, word) in [
        ("theta_i,phi_i,phi_o\n0,0,0\n", "theta_o"),
        ("theta_i,theta_o\n0.1,0.2\n0.1,x\n", "line 3"),
        ("theta_i,theta_o\n2,0.2\n", "theta_i"),
        ("theta_i,theta_o\n", "only a header"),
        ("", "nothing"),
    ] {
        fs::write(&asked, text).unwrap();
        let paths = [&model, &asked, &out].map(|path| path.to_str().unwrap());
        let command = ["predict", paths[0], paths[1], "-o", paths[2]];
        let (said, _) = program.refusal(&command);
        let errors = said.lines().filter(|line| line.starts_with("error: "));
        assert!(errors.count() == 1 && said.contains(word), "{said}");
        assert!(!out.exists());
    }
    // Over its own input.
    let paths = [&model, &asked].map(|path| path.to_str().unwrap());
    let command = ["predict", paths[0], paths[1], "-o", paths[1]];
    program.command().args(command).assert().code(2);
}

#[test]
fn a_models_file_says_what_it_holds() {
    let (program, dir) = (Program::new(), tempfile::tempdir().unwrap());
    let model = model(&program, dir.path());
    let path = model.to_str().unwrap();
    let json: serde_json::Value =
        serde_json::from_str(&program.output(&["info", path, "--format", "json"])).unwrap();
    let own: BrdfModel = elm::persist::load(&model).unwrap();
    assert_eq!(json["rows"], 205);
    assert_eq!(json["channels"], serde_json::json!(["red", "450 nm"]));
    assert_eq!(json["neurons"], 30);
    assert_eq!(json["stored_floats"], own.stored_floats());
    assert_eq!(json["file_bytes"], fs::metadata(&model).unwrap().len());
    let data = synthetic::measurements(1, &[MaterialId::new(39).unwrap()], Invalid::Clamp);
    let largest = data
        .directions
        .iter()
        .map(|pair| Angles::of(pair).theta_i.to_degrees());
    let largest = largest.fold(0.0, f64::max);
    let found = json["measured_to_degrees"][0].as_f64().unwrap();
    assert!((found - largest).abs() < 1e-6, "{found} {largest}");
    for angle in json["albedo"].as_array().unwrap() {
        assert!(angle[1].as_f64().unwrap() > 0.0);
    }
    let table = program.output(&["info", path]);
    for word in [
        "205 measurements",
        "red, 450 nm",
        "held out",
        "30 neurons",
        "bytes",
        "albedo",
    ] {
        assert!(table.contains(word), "{word}: {table}");
    }
    let refused = program
        .command()
        .args(["info", "none.elm"])
        .assert()
        .code(1);
    let said = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
    assert!(
        said.starts_with("error: ") && said.contains("none.elm"),
        "{said}"
    );
}
