//! `elm-brdf compare` as a user runs it.

mod support;

use serde_json::Value;
use support::Program;

#[test]
fn every_model_is_judged_and_the_best_comes_first() {
    let arguments = [
        "compare",
        "--materials",
        "39",
        "--folds",
        "2",
        "--format",
        "json",
    ];
    let report: Value = serde_json::from_str(&Program::new().output(&arguments)).unwrap();
    assert_eq!(report["data"]["synthetic"], true);
    let models = report["models"].as_array().unwrap();
    for name in [
        "lambert",
        "phong",
        "koenderink-8",
        "gaussian-process",
        "elm (paper)",
    ] {
        assert!(models.iter().any(|m| m["model"] == name), "{name}");
    }
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
    // The stand-in is no measurement, so there is nothing to set beside the paper.
    assert!(models.iter().all(|m| m["rmse_ratio_to_paper"].is_null()));
}

#[test]
fn what_cannot_be_compared_is_said_in_one_line() {
    for (arguments, code, part) in [
        (["--folds", "1"], 2, "expected 2 to 205 folds"),
        (["--materials", "nosuch"], 2, "nosuch"),
        (["--data", "/no/such/folder"], 1, "/no/such/folder"),
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
