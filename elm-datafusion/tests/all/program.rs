//! The program as a user runs it.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// Runs the program in a folder.
pub(crate) fn elm(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_elm"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

fn good(folder: &Path, arguments: &[&str]) -> String {
    let output = elm(folder, arguments);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

fn bad(folder: &Path, arguments: &[&str]) -> String {
    let output = elm(folder, arguments);
    assert_eq!(output.status.code(), Some(1), "{arguments:?}");
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(!errors.contains("panicked"), "{errors}");
    errors
}

/// `name` with 300 rows of a, b, kind and y.
pub(crate) fn rows(folder: &Path, name: &str) {
    let mut text = String::from("a,b,kind,sensor,y\n");
    for row in 0..300 {
        let (a, b) = ((f64::from(row) * 0.7).sin(), (f64::from(row) * 1.3).cos());
        let (kind, shift) = if row % 3 == 0 {
            ("red", 1.0)
        } else {
            ("blue", 0.0)
        };
        let y = a * b + shift;
        text += &format!("{a},{b},{kind},{},{y}\n", row % 4);
    }
    fs::write(folder.join(name), text).unwrap();
}

#[test]
fn fits_predicts_and_evaluates_every_kind_of_file() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    rows(folder, "rows.csv");
    for end in ["parquet", "json", "arrow", "csv"] {
        let copy = format!("copy.{end}");
        good(folder, &["sql", "SELECT * FROM 'rows.csv'", "-o", &copy]);
        good(
            folder,
            &[
                "fit",
                &copy,
                "--target",
                "y",
                "--neurons",
                "60",
                "-o",
                "m.elm",
            ],
        );
        let report = good(folder, &["eval", "m.elm", &copy]);
        assert!(report.contains("rows  300"), "{report}");
        let r2: f64 = report.split_whitespace().last().unwrap().parse().unwrap();
        assert!(r2 > 0.98, "{end}: {report}");
        good(
            folder,
            &["predict", "m.elm", &copy, "-o", &format!("out.{end}")],
        );
        let count = good(
            folder,
            &["sql", &format!("SELECT count(prediction) FROM 'out.{end}'")],
        );
        assert!(count.contains("300"), "{count}");
    }
    let info = good(folder, &["info", "m.elm"]);
    assert!(info.contains("kind (text: blue, red)"), "{info}");
}

#[test]
fn one_network_per_group() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    rows(folder, "rows.csv");
    let fit = [
        "fit",
        "rows.csv",
        "--target",
        "y",
        "--group-by",
        "sensor",
        "--neurons",
        "30",
    ];
    good(folder, &[&fit[..], &["-o", "models.parquet"]].concat());
    // In the groups' order, whichever partition was done first.
    let groups = good(folder, &["sql", "SELECT sensor FROM 'models.parquet'"]);
    let cells = groups.split('|').map(str::trim);
    let numbers: Vec<&str> = cells.filter(|cell| cell.parse::<u8>().is_ok()).collect();
    assert_eq!(numbers, ["0", "1", "2", "3"]);
    assert!(good(folder, &["info", "models.parquet"]).contains("groups    4, by sensor"));
    assert!(good(folder, &["eval", "models.parquet", "rows.csv"]).contains("rows  300"));
    good(
        folder,
        &["predict", "models.parquet", "rows.csv", "-o", "out.csv"],
    );
    let error = bad(folder, &[&fit[..], &["-o", "models.elm"]].concat());
    assert!(error.contains(".parquet"), "{error}");
    // Its own columns have names that no file's have.
    let query = "SELECT a, b, y, sensor AS rows FROM 'rows.csv'";
    good(folder, &["sql", query, "-o", "named.csv"]);
    let fit = ["fit", "named.csv", "--target", "y", "--group-by", "rows"];
    good(folder, &[&fit[..], &["-o", "named.parquet"]].concat());
    // But for the one of the networks.
    let query = "SELECT a, b, y, sensor AS model FROM 'rows.csv'";
    good(folder, &["sql", query, "-o", "named.csv"]);
    let fit = ["fit", "named.csv", "--target", "y", "--group-by", "model"];
    let error = bad(folder, &[&fit[..], &["-o", "named.parquet"]].concat());
    assert!(
        error.contains("column 'model' cannot be a group"),
        "{error}"
    );
}

#[test]
fn settings_are_searched_on_a_sample() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    rows(folder, "rows.csv");
    let fit = [
        "fit",
        "rows.csv",
        "--target",
        "y",
        "--neurons",
        "auto",
        "--group-rows",
        "100",
    ];
    good(folder, &[&fit[..], &["-o", "m.elm"]].concat());
    let report = good(folder, &["eval", "m.elm", "rows.csv"]);
    let r2: f64 = report.split_whitespace().last().unwrap().parse().unwrap();
    assert!(r2 > 0.999, "{report}");
}

#[test]
fn errors_name_the_place_and_leave_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for name in ["p-1.csv", "p-2.csv"] {
        rows(folder, name);
    }
    fs::write(folder.join("q-1.csv"), "a,y\n1,2\n2,3\n").unwrap();
    fs::write(folder.join("q-2.csv"), "b,y\n1,2\n2,3\n").unwrap();
    fs::write(folder.join("few.csv"), "a,y\n1,5\n2,5\n").unwrap();
    fs::write(folder.join("none.csv"), "a,y\n").unwrap();
    fs::write(folder.join("mixed.csv"), "a,y\nabc,1\n2,3\n").unwrap();
    fs::write(folder.join("broken.parquet"), b"PAR1 and then nothing").unwrap();
    let mut text = String::from("a,y\n");
    for row in 0..3000 {
        text += &if row == 2500 {
            "1,oops\n".to_owned()
        } else {
            format!("{row},{row}\n")
        };
    }
    fs::write(folder.join("text.csv"), text).unwrap();
    let fit = |file, rest: &[&str]| {
        let arguments = [&["fit", file, "--target", "y", "-o", "m.elm"][..], rest].concat();
        let error = bad(folder, &arguments);
        assert!(!folder.join("m.elm").exists(), "{error}");
        error
    };
    for (file, rest, expected) in [
        ("q-*.csv", &[][..], "q-2.csv: no column 'a'"),
        ("text.csv", &[], "oops"),
        (
            "mixed.csv",
            &[],
            "column 'a' holds numbers and text such as 'abc'",
        ),
        ("broken.parquet", &[], "broken.parquet"),
        ("few.csv", &[], "constant"),
        ("none.csv", &[], "no rows"),
        ("absent*.csv", &[], "absent*.csv: no such file"),
        ("p-1.csv", &["--features", "c"], "no column 'c'"),
        ("p-1.csv", &["--features", "y"], "'y' cannot be a feature"),
        (
            "p-1.csv",
            &["--categories", "1"],
            "column 'kind' is text of more than 1 values",
        ),
        ("p-1.csv", &["--neurons", "many"], "--neurons is 'many'"),
        ("p-1.csv", &["--neurons", "0"], "neurons"),
        ("p-1.txt", &[], "p-1.txt: no such file"),
    ] {
        let error = fit(file, rest);
        assert!(error.contains(expected), "{expected}: {error}");
    }
    let error = bad(folder, &["sql", "SELECT elm_fit(y, kind) FROM 'p-1.csv'"]);
    let expected = "elm_fit: argument 2 is Utf8; expected a number";
    assert!(
        error.contains(expected) && error.trim().lines().count() == 1,
        "{error}"
    );
    let fit = ["fit", "p-1.csv", "--target", "y", "-o"];
    let error = bad(folder, &[&fit[..], &["nowhere/m.elm"]].concat());
    assert!(error.contains("no folder nowhere"), "{error}");
    good(folder, &[&fit[..], &["m.elm"]].concat());
    let error = bad(folder, &["predict", "m.elm", "q-1.csv", "-o", "out.csv"]);
    assert!(error.contains("q-1.csv: no column 'b'"), "{error}");
    let error = bad(
        folder,
        &["predict", "m.elm", "p-1.csv", "-o", "nowhere/out.csv"],
    );
    assert!(error.contains("cannot write nowhere/out.csv"), "{error}");
    let error = bad(folder, &["eval", "m.elm", "p-1.csv", "--target", "kind"]);
    assert!(error.contains("column 'kind' is"), "{error}");
    let mut names: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    names.retain(|name| name.to_string_lossy().starts_with('.'));
    assert_eq!(names.len(), 0, "{names:?}");
}

#[test]
fn plans_are_printed() {
    let folder = tempfile::tempdir().unwrap();
    rows(folder.path(), "p.csv");
    let plan = good(
        folder.path(),
        &["sql", "EXPLAIN SELECT count(y) FROM 'p.csv'"],
    );
    assert!(plan.contains("physical_plan"), "{plan}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_one_clear_error() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    rows(folder, "p.csv");
    std::os::unix::fs::symlink("/dev/full", folder.join("full.csv")).unwrap();
    let error = bad(folder, &["sql", "SELECT * FROM 'p.csv'", "-o", "full.csv"]);
    assert!(error.contains("cannot write full.csv"), "{error}");
    assert!(error.contains("No space left"), "{error}");
}
