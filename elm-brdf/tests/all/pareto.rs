//! `elm-brdf pareto` as a user runs it.

use std::fs;
use std::path::{Path, PathBuf};

use crate::support::Program;
use serde_json::Value;

/// A file of `rows` of a metallic paint, drawn by this seed.
fn paint(program: &Program, name: &str, rows: usize, seed: u64) -> PathBuf {
    let paint = elm_datasets::paint::samples(rows, seed).unwrap();
    let mut text = "theta_i,phi_i,theta_o,phi_o,red,green,blue\n".to_owned();
    for (d, v) in paint.directions.iter().zip(paint.values.rows()) {
        let d = elm_datasets::Angles::of(d);
        let numbers = [d.theta_i, d.phi_i, d.theta_o, d.phi_o, v[0], v[1], v[2]];
        text.push_str(&numbers.map(|number| number.to_string()).join(","));
        text.push('\n');
    }
    fs::create_dir_all(program.cache()).unwrap();
    let path = program.cache().join(name);
    fs::write(&path, text).unwrap();
    path
}

/// What the four files of a folder say; the JSON's list.
fn results(dir: &Path) -> Vec<Value> {
    let text = fs::read_to_string(dir.join("pareto.json")).unwrap();
    let list: Vec<Value> = serde_json::from_str(&text).unwrap();
    for point in &list {
        let mut keys: Vec<&String> = point.as_object().unwrap().keys().collect();
        keys.sort();
        let expected = [
            "error",
            "fit_seconds",
            "floats",
            "model",
            "nanoseconds_per_evaluation",
            "on_front",
        ];
        assert_eq!(keys, expected);
        assert!(point["error"].as_f64().unwrap() > 0.0, "{point}");
        assert!(point["fit_seconds"].as_f64().unwrap() > 0.0, "{point}");
        assert!(point["nanoseconds_per_evaluation"].as_f64().unwrap() > 0.0);
        assert!(point["floats"].as_u64().unwrap() > 0, "{point}");
    }
    // Whatever is on the front is beaten by nothing in both.
    let both = |point: &Value| {
        let of = |key: &str| point[key].as_f64().unwrap();
        (of("nanoseconds_per_evaluation"), of("error"))
    };
    for point in list.iter().filter(|point| point["on_front"] == true) {
        let (time, error) = both(point);
        assert!(
            !list
                .iter()
                .any(|other| both(other).0 < time && both(other).1 <= error),
            "{point}"
        );
    }
    let csv = fs::read_to_string(dir.join("pareto.csv")).unwrap();
    assert_eq!(csv.lines().count(), list.len() + 1);
    assert!(
        fs::read_to_string(dir.join("pareto.svg"))
            .unwrap()
            .starts_with("<svg")
    );
    image::open(dir.join("pareto.png")).unwrap();
    list
}

#[test]
fn the_synthetic_materials_are_weighed_and_the_front_is_named() {
    let program = Program::new();
    let out = program.cache().join("out");
    let arguments = [
        "pareto",
        "--materials",
        "39",
        "--folds",
        "2",
        "--models",
        "elm squared-relu 16,elm sine 16 drawn,lambert,ggx+lambert,nearest",
        "--out",
        out.to_str().unwrap(),
    ];
    let text = program.output(&arguments);
    let list = results(&out);
    let has = |name: &str| list.iter().any(|point| point["model"] == name);
    for name in [
        "elm squared-relu 16 pruned, f32",
        "elm squared-relu 16 drawn, f64",
        "elm sine 16 drawn, f32",
        "lambert",
        "nearest (paper, identity)",
    ] {
        assert!(has(name), "{name}");
    }
    for point in list.iter().filter(|point| point["on_front"] == true) {
        assert!(text.contains(point["model"].as_str().unwrap()), "{text}");
    }
    assert!(text.contains("synthetic"), "{text}");
}

#[test]
fn samples_are_judged_on_the_test_file_beside_them_or_named_or_on_a_part_of_their_rows() {
    let program = Program::new();
    let train = paint(&program, "paint_train.csv", 400, 1);
    paint(&program, "paint_test.csv", 90, 2);
    let other = paint(&program, "other.csv", 250, 3);
    let weights = program.cache().join("paint.f32");
    let bytes: Vec<u8> = (0..675_u16)
        .flat_map(|k| (f32::from(k % 7) * 0.02 - 0.05).to_le_bytes())
        .collect();
    fs::write(&weights, bytes).unwrap();
    let out = program.cache().join("out");
    let run = |rest: &[&str]| {
        let start = ["pareto", "--models", "elm relu 16 drawn", "--out"];
        program.output(&[&start[..], &[out.to_str().unwrap()], rest].concat())
    };
    let (train, other) = (train.to_str().unwrap(), other.to_str().unwrap());

    let text = run(&[
        "--samples",
        train,
        "--nbrdf",
        program.cache().to_str().unwrap(),
    ]);
    assert!(
        text.contains("400 rows fitted to") && text.contains("90 rows"),
        "{text}"
    );
    assert!(text.contains("NBRDF"), "{text}");
    let list = results(&out);
    let published = list.iter().find(|p| p["model"] == "nbrdf (published)");
    assert_eq!(published.unwrap()["floats"], 675);
    assert_eq!(list.len(), 3);

    let text = run(&["--samples", other]);
    assert!(
        text.contains("200 rows fitted to") && text.contains("50 rows"),
        "{text}"
    );
    let text = run(&["--samples", other, "--test", train]);
    assert!(
        text.contains("250 rows fitted to") && text.contains("400 rows"),
        "{text}"
    );

    run(&["--samples", train, "--samples", other]);
    results(&out.join("paint"));
    results(&out.join("other"));
}

#[test]
fn what_cannot_be_weighed_is_said_in_one_line() {
    let program = Program::new();
    let train = paint(&program, "own.csv", 30, 1);
    let train = train.to_str().unwrap();
    let bad = program.cache().join("bad.f32");
    fs::write(&bad, [0; 100]).unwrap();
    let bad = bad.to_str().unwrap();
    let out = program.cache().join("out");
    let out = out.to_str().unwrap();
    let table: &[(&[&str], i32, &str)] = &[
        (&[], 2, "--out"),
        (
            &["--out", out, "--folds", "1"],
            2,
            "expected 2 to 205 folds",
        ),
        (&["--out", out, "--materials", "nosuch"], 2, "nosuch"),
        (&["--out", out, "--models", "elm,best"], 2, "'best'"),
        (&["--out", out, "--metric", "ssim"], 2, "ssim"),
        (&["--out", out, "--nbrdf", bad], 2, "--samples"),
        (
            &["--out", out, "--data", "/no/such/folder"],
            1,
            "/no/such/folder",
        ),
        (
            &["--out", out, "--samples", "no/such.csv"],
            1,
            "no/such.csv",
        ),
        (
            &["--out", out, "--samples", train, "--nbrdf", bad],
            1,
            "bad.f32: 100 bytes",
        ),
        (
            &["--out", out, "--samples", train, "--nbrdf", "/no/weights"],
            1,
            "/no/weights",
        ),
        (
            &[
                "--out",
                out,
                "--samples",
                train,
                "--test",
                train,
                "--test",
                train,
            ],
            2,
            "2 --test for 1 --samples",
        ),
        (
            &["--out", bad, "--samples", train, "--models", "lambert"],
            1,
            "bad.f32",
        ),
    ];
    for (arguments, code, part) in table {
        let assert = program
            .command()
            .arg("pareto")
            .args(*arguments)
            .assert()
            .code(*code);
        let error = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
        assert!(
            error.starts_with("error: ") && error.contains(part),
            "{arguments:?}: {error}"
        );
        assert_eq!(error.lines().count(), 1, "{error}");
    }
    assert!(!Path::new(out).exists());
}
