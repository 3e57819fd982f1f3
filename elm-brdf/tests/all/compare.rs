//! `elm-brdf compare` as a user runs it.

use std::fs;

use crate::support::Program;
use serde_json::Value;

#[test]
fn the_models_asked_for_are_judged_and_the_best_comes_first() {
    let arguments = [
        "compare",
        "--materials",
        "39",
        "--models",
        "lambert, phong,koenderink-8,thin-plate,elm (paper)",
        "--folds",
        "2",
        "--format",
        "json",
    ];
    let report: Value = serde_json::from_str(&Program::new().output(&arguments)).unwrap();
    crate::support::check_schema("compare", &report);
    assert_eq!(report["data"]["synthetic"], true);
    let models = report["models"].as_array().unwrap();
    let count = |name: &str| models.iter().filter(|m| m["model"] == name).count();
    for name in ["lambert", "phong", "koenderink-8", "elm (paper)"] {
        assert_eq!(count(name), 1, "{name}");
    }
    // On the paper's inputs with both targets, and on two other sets.
    assert_eq!((count("thin-plate"), models.len()), (4, 8));
    let errors: Vec<f64> = models
        .iter()
        .map(|model| model["rmse"].as_f64().unwrap())
        .collect();
    assert!(errors.is_sorted(), "{errors:?}");
    assert!(
        models
            .iter()
            .all(|m| m["floats_per_channel"].as_u64().unwrap() > 0)
    );
    // The synthetic data is no measurement, so there is nothing to set beside the paper.
    assert!(models.iter().all(|m| m["rmse_ratio_to_paper"].is_null()));
}

/// A file of `rows` of a metallic paint.
fn paint_csv(program: &Program, rows: usize) -> String {
    let paint = elm_datasets::paint::samples(rows, 2).unwrap();
    let mut text = "theta_i,phi_i,theta_o,phi_o,red,green,blue\n".to_owned();
    for (d, v) in paint.directions.iter().zip(paint.values.rows()) {
        let d = elm_datasets::Angles::of(d);
        let numbers = [d.theta_i, d.phi_i, d.theta_o, d.phi_o, v[0], v[1], v[2]];
        text.push_str(&numbers.map(|number| number.to_string()).join(","));
        text.push('\n');
    }
    let path = program.cache().join("paint.csv");
    fs::create_dir_all(program.cache()).unwrap();
    fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn samples_of_ones_own_are_compared_as_a_material_is() {
    let program = Program::new();
    let file = paint_csv(&program, 300);
    let report = |samples: &str| -> Value {
        let arguments = [
            "compare",
            samples,
            "--models",
            "ggx+lambert,nearest,lambert",
        ];
        let rest = [
            "--folds", "3", "--rows", "300", "--seeds", "2", "--format", "json",
        ];
        serde_json::from_str(&program.output(&[&arguments[..], &rest].concat())).unwrap()
    };
    for (samples, synthetic, name, rows) in [
        (file.as_str(), false, "paint", 300),
        ("synthetic:paint", true, "metallic paint", 300),
        ("curet:matte 02", true, "Matte 02", 205),
    ] {
        let report = report(samples);
        crate::support::check_schema("compare", &report);
        assert_eq!(report["data"]["synthetic"], synthetic, "{samples}");
        assert_eq!(report["data"]["measurements"], rows, "{samples}");
        let best = &report["models"][0];
        assert_eq!(best["materials"][0]["name"], name, "{samples}");
        assert!(best["rmse_deviation"].is_f64());
        let wins = |model: &Value| model["wins"].as_u64().unwrap();
        let models = report["models"].as_array().unwrap();
        assert_eq!(models.iter().map(wins).sum::<u64>(), 3, "{samples}");
    }
}

#[test]
fn methods_that_grow_too_fast_are_given_a_part_of_many_rows_and_the_table_says_so() {
    let arguments = [
        "compare",
        "synthetic:paint",
        "--rows",
        "4100",
        "--folds",
        "2",
        "--models",
        "ggx+lambert,koenderink-2",
    ];
    let text = Program::new().output(&arguments);
    let rows = |model: &str| {
        let line = text.lines().find(|line| line.trim().starts_with(model));
        line.unwrap()
            .split_whitespace()
            .rev()
            .nth(1)
            .unwrap()
            .to_owned()
    };
    assert_eq!(rows("ggx+lambert"), "2000", "{text}");
    assert_eq!(rows("koenderink-2"), "2050", "{text}");
    assert!(text.contains("a random subset"), "{text}");
}

#[test]
fn what_cannot_be_compared_is_said_in_one_line() {
    for (arguments, code, part) in [
        (["--folds", "1"], 2, "expected 2 to 205 folds"),
        (["--materials", "nosuch"], 2, "nosuch"),
        (["--models", "lambert,best"], 2, "unknown model 'best'"),
        (["--data", "/no/such/folder"], 1, "/no/such/folder"),
        (["--seeds", "0"], 2, "--seeds"),
        (["no/such.csv", "--degrees"], 1, "no/such.csv"),
        (["synthetic:gold", "--degrees"], 2, "synthetic:paint"),
        (["curet:all", "--degrees"], 2, "61 materials"),
        (["curet:nosuch", "--degrees"], 2, "nosuch"),
        (["synthetic:paint", "--rows=0"], 1, "0"),
        (["synthetic:paint", "--rows=1"], 2, "of 1 measurements"),
    ] {
        let assert = Program::new()
            .command()
            .arg("compare")
            .args(arguments)
            .assert()
            .code(code);
        let error = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
        assert!(
            error.starts_with("error: ") && error.contains(part),
            "{error}"
        );
        assert_eq!(error.lines().count(), 1, "{error}");
    }
}
