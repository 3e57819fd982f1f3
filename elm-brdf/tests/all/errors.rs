//! What a user reads when something is wrong: one line on standard error, nothing on standard
//! output, and an exit code that tells bad usage (2) from failure (1).

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::support::Program;
use elm_datasets::{Invalid, MaterialId, curet, synthetic};

fn refused(arguments: &[&str], code: i32, expected: &[&str]) {
    let (line, found) = Program::new().refusal(arguments);
    assert_eq!(found, code, "{arguments:?}: {line}");
    assert_eq!(line.lines().count(), 1, "{arguments:?}: {line}");
    assert!(line.starts_with("error: "), "{arguments:?}: {line}");
    for text in expected {
        assert!(
            line.contains(text),
            "{arguments:?}: '{text}' is not in: {line}"
        );
    }
}

/// A folder of the synthetic files after `damage`.
fn damaged(damage: impl FnOnce(&Path)) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let all: Vec<MaterialId> = MaterialId::all().collect();
    curet::write(dir.path(), &synthetic::measurements(1, &all, Invalid::Keep)).unwrap();
    damage(dir.path());
    dir
}

#[test]
fn bad_usage_is_refused_in_one_line() {
    for (arguments, expected) in [
        (
            &["reproduce", "--folds", "0"][..],
            &["0 folds", "2 to 205"][..],
        ),
        (&["reproduce", "--folds", "1"], &["1 folds", "2 to 205"]),
        (
            &["export", "curet:1", "-o", "a.png"],
            &["a.png", ".glsl", ".binary"],
        ),
        (
            &["export", "curet:1", "-o", "a.c", "--format", "rust"],
            &["rust", "glsl"],
        ),
        (&["gallery"], &["--out"]),
        (
            &["gallery", "--out", "a", "--materials", "62"],
            &["62", "61"],
        ),
        (&["reproduce", "--folds", "206"], &["206 folds", "2 to 205"]),
        (&["reproduce", "--folds", "-1"], &["--folds"]),
        (&["reproduce", "--neurons", "0"], &["neurons", "at least 1"]),
        (&["reproduce", "--neurons", "many"], &["--neurons", "many"]),
        (
            &["reproduce", "--materials", "unobtainium"],
            &["unobtainium"],
        ),
        (&["reproduce", "--materials", "62"], &["62", "61"]),
        (&["reproduce", "--materials", ""], &["material"]),
        (
            &["reproduce", "--activation", "softmax"],
            &["softmax", "sigmoid"],
        ),
        (
            &["reproduce", "--solver", "magic"],
            &["magic", "pseudo-inverse"],
        ),
        (&["reproduce", "--format", "yaml"], &["yaml", "markdown"]),
        (&["reproduce", "--frobnicate"], &["--frobnicate"]),
        (&["frobnicate"], &["frobnicate"]),
        (&[], &["command"]),
    ] {
        refused(arguments, 2, expected);
    }
}

#[test]
fn equation_10_with_the_wrong_number_of_neurons_says_what_it_needs() {
    refused(
        &["reproduce", "--solver", "inverse"],
        1,
        &["eq. 10", "50 neurons", "184 rows"],
    );
}

#[test]
fn a_folder_without_data_or_that_does_not_exist_is_named() {
    let empty = tempfile::tempdir().unwrap();
    let path = empty.path().to_str().unwrap();
    refused(&["reproduce", "--data", path], 1, &[path, "abrdf.dat"]);
    let nowhere = empty.path().join("nowhere");
    let path = nowhere.to_str().unwrap();
    refused(&["reproduce", "--data", path], 1, &[path, "no such folder"]);
}

#[test]
fn a_missing_file_is_named() {
    let dir = damaged(|dir| fs::remove_file(dir.join("table.txt")).unwrap());
    refused(
        &["reproduce", "--data", dir.path().to_str().unwrap()],
        1,
        &["table.txt"],
    );
    let dir = damaged(|dir| fs::remove_file(dir.join("gbrdf.dat")).unwrap());
    let path = dir.path().to_str().unwrap();
    refused(
        &["reproduce", "--data", path],
        1,
        &["gbrdf.dat", "rbrdf.dat"],
    );
}

#[test]
fn a_damaged_table_is_named_with_its_line() {
    let cut = |dir: &Path| {
        let path = dir.join("table.txt");
        let text = fs::read_to_string(&path).unwrap().replacen("0.", "0,", 3);
        fs::write(path, text).unwrap();
    };
    let dir = damaged(cut);
    refused(
        &["reproduce", "--data", dir.path().to_str().unwrap()],
        1,
        &["table.txt", "line"],
    );
}

#[test]
fn a_damaged_value_is_named_with_its_line() {
    let damage = |dir: &Path| {
        let path = dir.join("bbrdf.dat");
        let text = fs::read_to_string(&path).unwrap();
        let lines: Vec<String> = text
            .lines()
            .map(|line| match line.trim_start().strip_prefix("12 ") {
                Some(rest) => format!("12 {}", rest.replacen('.', "x", 1)),
                None => line.to_owned(),
            })
            .collect();
        fs::write(path, lines.join("\n")).unwrap();
    };
    let dir = damaged(damage);
    let path = dir.path().to_str().unwrap();
    refused(&["reproduce", "--data", path], 1, &["bbrdf.dat", "line 12"]);
    // Only the materials asked for are read.
    Program::new().output(&["reproduce", "--data", path, "--materials", "1,61"]);
}

#[test]
fn an_output_folder_that_cannot_be_made_is_named() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let below = file.path().join("below");
    let path = below.to_str().unwrap();
    refused(
        &["reproduce", "--materials", "1", "--out", path],
        1,
        &["cannot write", path],
    );
}

#[test]
fn help_and_version_are_results() {
    let program = Program::new();
    assert!(program.output(&["--help"]).contains("reproduce"));
    assert!(
        program
            .output(&["--version"])
            .contains(env!("CARGO_PKG_VERSION"))
    );
    let help = program.output(&["reproduce", "--help"]);
    for flag in [
        "--data",
        "--materials",
        "--folds",
        "--seed",
        "--neurons",
        "--activation",
        "--solver",
        "--format",
        "--out",
        "--invalid",
    ] {
        assert!(help.contains(flag), "{flag}");
    }
}

#[test]
fn a_reader_that_stops_reading_is_no_failure() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_elm-brdf"))
        .args(["reproduce", "--materials", "all", "--format", "csv"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{:?}", output.status);
    assert_eq!(String::from_utf8(output.stderr).unwrap(), "");
}
