//! Files for renderers as a user makes them: from a sweep in the plane of incidence, and what is refused.

use std::f64::consts::PI;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use crate::support::Program;
use elm_datasets::geometry::{DirectionPair, cartesian};
use elm_datasets::lobes;
use elm_datasets::rgl::Rgl;
use elm_datasets::scattered::{self, Options};

/// A goniometer's sweep: the viewer at 30 degrees, the light at 90 angles in its plane.
fn sweep(channels: &[&str]) -> String {
    let mut text = format!("theta_i,phi_i,theta_o,phi_o,{}\n", channels.join(","));
    for step in 0..90 {
        let degrees = -89.0 + 2.0 * f64::from(step);
        let (theta, phi) = (
            degrees.abs().to_radians(),
            if degrees < 0.0 { PI } else { 0.0 },
        );
        let pair = DirectionPair {
            incident: cartesian(theta, phi),
            outgoing: cartesian(PI / 6.0, 0.0),
        };
        let value = 0.1 / PI + lobes::ggx(&pair, 0.04, 0.2);
        let _ = write!(text, "{theta},{phi},{},0", PI / 6.0);
        for channel in 0..channels.len() {
            let _ = write!(text, ",{}", value * (1.0 - 0.2 * channel as f64));
        }
        text.push('\n');
    }
    text
}

#[test]
fn a_sweep_in_one_plane_goes_through_fit_and_both_exports_without_an_artefact() {
    let program = Program::new();
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    fs::write(path("sweep.csv"), sweep(&["r", "g", "b"])).unwrap();
    let run = |arguments: &[&str]| {
        program.command().args(arguments).assert().success();
    };
    run(&["fit", &path("sweep.csv"), "-o", &path("sweep.elm")]);
    run(&["export", &path("sweep.elm"), "-o", &path("sweep.bsdf")]);
    run(&[
        "export",
        &path("sweep.elm"),
        "-o",
        &path("sweep.py"),
        "--name",
        "sweep",
    ]);
    let plugin = fs::read_to_string(path("sweep.py")).unwrap();
    assert!(plugin.contains("NAME = 'sweep'"));

    let measured = scattered::read(path("sweep.csv"), &Options::default()).unwrap();
    let largest = measured.values.iter().copied().fold(0.0, f64::max);
    let file = Rgl::read(path("sweep.bsdf")).unwrap();
    for theta_i in [0.0, 0.3, 0.52, 0.8, 1.2] {
        for theta_o in [0.0, 0.3, 0.52, 0.8, 1.2] {
            let around: Vec<f64> = (0..360)
                .map(|degrees| {
                    let pair = DirectionPair {
                        incident: cartesian(theta_i, f64::from(degrees).to_radians()),
                        outgoing: cartesian(theta_o, 0.0),
                    };
                    file.at(&pair)[0]
                })
                .collect();
            let top = around.iter().copied().fold(0.0, f64::max);
            assert!(
                top <= 2.0 * largest,
                "{theta_i} {theta_o}: {top} of {largest}"
            );
            // Smooth across the azimuth: a degree is a small part of the way from the least to the largest.
            let bottom = around.iter().copied().fold(f64::INFINITY, f64::min);
            for pair in around.windows(2) {
                let step = (pair[1] - pair[0]).abs();
                assert!(
                    step <= 0.1 * (top - bottom) + 0.02 * top,
                    "{theta_i} {theta_o}: {pair:?}"
                );
            }
        }
    }
}

/// The last line of what a failing command says, which must be one line, and must leave nothing behind.
fn refused(program: &Program, arguments: &[&str], out: &str) -> String {
    let assert = program.command().args(arguments).assert().failure();
    let said = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
    let said: Vec<&str> = said.lines().collect();
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(!Path::new(out).exists(), "{out}");
    said[0].to_owned()
}

#[test]
fn what_a_renderer_cannot_take_is_refused_in_one_line_and_nothing_is_left() {
    let program = Program::new();
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    fs::write(path("grey.csv"), sweep(&["value"])).unwrap();
    fs::write(path("two.csv"), sweep(&["up", "down"])).unwrap();
    fs::write(
        path("four.csv"),
        sweep(&["400nm", "500nm", "600nm", "700nm"]),
    )
    .unwrap();
    for name in ["grey", "two", "four"] {
        let arguments = [
            "fit",
            &path(&format!("{name}.csv")),
            "-o",
            &path(&format!("{name}.elm")),
        ];
        program.command().args(arguments).assert().success();
    }
    let out = path("out.bsdf");
    for (model, extra, expected) in [
        ("two.elm", vec![], "red, green and blue"),
        (
            "grey.elm",
            vec!["--spectral", "--resolution", "1"],
            "resolution from 4 to 256",
        ),
    ] {
        let model = path(model);
        let mut arguments = vec!["export", &model, "-o", &out];
        arguments.extend(extra);
        let said = refused(&program, &arguments, &out);
        assert!(said.contains(expected), "{said}");
    }
    let nowhere = path("no-such-folder/out.bsdf");
    let model = path("grey.elm");
    let said = refused(
        &program,
        &["export", &model, "-o", &nowhere, "--spectral"],
        &nowhere,
    );
    assert!(said.contains("no-such-folder"), "{said}");
    let glsl = path("out.glsl");
    let said = refused(
        &program,
        &["export", &model, "-o", &glsl, "--spectral"],
        &glsl,
    );
    assert!(said.contains(".bsdf"), "{said}");
    let said = refused(
        &program,
        &["export", &model, "-o", &glsl, "--double"],
        &glsl,
    );
    assert!(said.contains(".onnx"), "{said}");
    let onnx = path("out.onnx");
    let size = |extra: &[&str]| {
        let arguments = ["export", &path("four.elm"), "-o", &onnx];
        program
            .command()
            .args(arguments)
            .args(extra)
            .assert()
            .success();
        std::fs::read(&onnx).unwrap()
    };
    // Whether they say what the model says, the Python package's tests find out.
    for bytes in [size(&[]), size(&["--double"])] {
        for word in [&b"light"[..], b"viewer", b"values", b"400nm"] {
            assert!(bytes.windows(word.len()).any(|found| found == word));
        }
    }
    for name in ["four.elm", "grey.elm"] {
        let arguments = [
            "export",
            &path(name),
            "-o",
            &out,
            "--spectral",
            "--resolution",
            "12",
        ];
        program.command().args(arguments).assert().success();
        assert!(Rgl::read(&out).is_ok());
    }
}
