//! `elm-brdf fit`, `eval` and `prior build` as a user runs them.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use crate::support::Program;
use elm_datasets::{Invalid, MaterialId, synthetic};
use serde_json::Value;

/// Writes every `step`-th measurement of one of the synthetic materials, in degrees.
fn samples(path: &Path, material: usize, first: usize, step: usize) {
    let data = synthetic::measurements(1, &[MaterialId::new(material).unwrap()], Invalid::Clamp);
    let mut text = String::from("theta_i,phi_i,theta_o,phi_o,red,green\n");
    for row in (first..205).step_by(step) {
        let d = elm_datasets::Angles::of(&data.directions[row]);
        for angle in [d.theta_i, d.phi_i, d.theta_o, d.phi_o] {
            write!(text, "{},", angle.to_degrees()).unwrap();
        }
        let values = &data.materials[0].values;
        writeln!(text, "{},{}", values[[row, 0]], values[[row, 1]]).unwrap();
    }
    fs::write(path, text).unwrap();
}

fn eval(program: &Program, model: &Path, samples: &Path) -> Value {
    let (model, samples) = (model.to_str().unwrap(), samples.to_str().unwrap());
    let text = program.output(&["eval", model, samples, "--degrees", "--format", "json"]);
    serde_json::from_str(&text).unwrap()
}

#[test]
fn a_table_of_ones_own_becomes_a_model_that_meets_other_measurements() {
    let program = Program::new();
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    samples(&path("train.csv"), 39, 0, 2);
    samples(&path("test.csv"), 39, 1, 2);
    let train = path("train.csv");
    for (name, more) in [
        ("usual.elm", &[][..]),
        (
            "small.json",
            &["--max-floats", "150", "--metric", "cube-root"],
        ),
        ("given.elm", &["--neurons", "40", "--features", "half-diff"]),
        ("reciprocal.elm", &["--reciprocal"]),
    ] {
        let model = path(name);
        let fixed = [
            "fit",
            train.to_str().unwrap(),
            "-o",
            model.to_str().unwrap(),
            "--degrees",
        ];
        let said = program.output(&[&fixed, more].concat());
        assert!(
            said.contains("103 measurements") && said.contains("red, green"),
            "{said}"
        );
        let found = eval(&program, &model, &path("test.csv"));
        assert_eq!(found["rows"], 102);
        assert_eq!(found["channels"], serde_json::json!(["red", "green"]));
        let floats = found["stored_floats"].as_u64().unwrap();
        assert!(name != "small.json" || floats <= 150, "{floats}");
        assert!(name != "given.elm" || found["neurons"] == 40);
        if name == "reciprocal.elm" {
            let model = elm_brdf::model::BrdfModel::load(&model).unwrap();
            assert!(model.features().is_reciprocal(), "{}", model.features());
        }
        let correlation = found["metrics"]["correlation"].as_f64().unwrap();
        assert!(correlation > 0.9, "{name}: {correlation}");
        for measure in ["rmse", "mae", "log_cosine_mae", "cube_root_rmse"] {
            assert!(found["metrics"][measure].as_f64().unwrap() > 0.0);
        }
    }
}

#[test]
fn priors_that_never_saw_a_material_help_where_measurements_are_few() {
    let program = Program::new();
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let (prior, few) = (path("prior.elm"), path("few.csv"));
    let (prior, few) = (prior.to_str().unwrap(), few.to_str().unwrap());
    let list = "9,19,29,39";
    let build = ["prior", "build", "-o", prior, "--without", list];
    let said = program.output(&[&build[..], &["--neurons", "300"]].concat());
    assert!(said.contains("without"), "{said}");
    let mut gain = 0.0;
    for material in [9, 19, 29, 39] {
        samples(Path::new(few), material, 3, 12);
        samples(&path("all.csv"), material, 0, 1);
        let error = |name: &str, more: &[&str]| {
            let model = path(name);
            let fixed = ["fit", few, "-o", model.to_str().unwrap(), "--degrees"];
            let said = program.output(&[&fixed, more].concat());
            assert_eq!(said.contains("prior: "), !more.is_empty(), "{said}");
            let found = eval(&program, &model, &path("all.csv"));
            found["metrics"]["rmse"].as_f64().unwrap()
        };
        gain += (error("without.elm", &[]) / error("with.elm", &["--prior", prior])).ln();
    }
    // Geometric mean over the four.
    assert!(gain > 0.0, "{gain}");
}

#[test]
fn what_cannot_be_fitted_or_judged_is_one_line_and_leaves_no_file() {
    let program = Program::new();
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    samples(&path("two.csv"), 39, 0, 2);
    fs::write(
        path("one.csv"),
        "theta_i,phi_i,theta_o,phi_o,grey\n0.1,0,0.2,0,0.3\n0.2,0,0.3,0,0.3\n",
    )
    .unwrap();
    fs::write(path("broken.elm"), "no model").unwrap();
    let (two, one, broken) = (path("two.csv"), path("one.csv"), path("broken.elm"));
    let (two, one, broken) = (
        two.to_str().unwrap(),
        one.to_str().unwrap(),
        broken.to_str().unwrap(),
    );
    let model = path("model.elm");
    let model = model.to_str().unwrap();
    program.output(&["fit", two, "-o", model, "--degrees", "--neurons", "5"]);
    let absent = path("absent.elm");
    let out = absent.to_str().unwrap();
    for (code, arguments, words) in [
        (
            2,
            vec!["fit", two, "-o", out, "--neurons", "0"],
            "--neurons",
        ),
        (
            1,
            vec!["fit", two, "-o", out, "--degrees", "--max-floats", "3"],
            "max_floats",
        ),
        (1, vec!["fit", "absent.csv", "-o", out], "absent.csv"),
        (
            1,
            vec!["fit", two, "-o", out, "--degrees", "--prior", broken],
            "broken.elm",
        ),
        (
            2,
            vec!["fit", two, "-o", out, "--prior", broken, "--neurons", "9"],
            "--neurons",
        ),
        (
            2,
            vec![
                "fit",
                two,
                "-o",
                out,
                "--reciprocal",
                "--features",
                "cosines",
            ],
            "--features",
        ),
        (1, vec!["eval", broken, two], "broken.elm"),
        (1, vec!["eval", model, one], "channels"),
        (
            2,
            vec!["prior", "build", "-o", out, "--neurons", "0"],
            "--neurons",
        ),
        (
            2,
            vec![
                "prior",
                "build",
                "-o",
                out,
                "--materials",
                "3",
                "--without",
                "3",
            ],
            "materials of a prior",
        ),
    ] {
        let assert = program.command().args(&arguments).assert().code(code);
        let message = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
        assert!(message.contains(words), "{arguments:?}: {message}");
        assert!(!absent.exists(), "{arguments:?}");
    }
}

#[test]
fn what_measurements_cannot_tell_is_a_warning_each() {
    let program = Program::new();
    let dir = tempfile::tempdir().unwrap();
    let model = dir.path().join("m.elm");
    let said = |rows: &[(f64, f64, f64)]| {
        let mut text = String::from("theta_i,phi_i,theta_o,phi_o,grey\n");
        for (theta_i, theta_o, phi_o) in rows {
            writeln!(text, "{theta_i},0,{theta_o},{phi_o},0.1").unwrap();
        }
        let table = dir.path().join("t.csv");
        fs::write(&table, text).unwrap();
        let (table, model) = (table.to_str().unwrap(), model.to_str().unwrap());
        program.output(&["fit", table, "-o", model, "--degrees"])
    };
    let few = said(&[(10.0, 20.0, 0.0), (30.0, 20.0, 90.0), (60.0, 45.0, 140.0)]);
    assert!(few.contains("warning: 3 measurements are few"), "{few}");
    assert!(
        few.contains("has the light or viewer above 60 degrees"),
        "{few}"
    );
    assert!(!few.contains("one plane"), "{few}");
    let grid = |light: f64| -> Vec<(f64, f64, f64)> {
        let numbers = (0..24).map(f64::from);
        numbers
            .map(|i| (light * i / 23.0, 80.0 * i / 23.0, 7.0 * i))
            .collect()
    };
    let flat = said(&grid(50.0));
    assert!(flat.contains("has the light above 60 degrees"), "{flat}");
    assert!(!flat.contains("are few"), "{flat}");
    assert!(!said(&grid(80.0)).contains("warning"), "{flat}");
}
