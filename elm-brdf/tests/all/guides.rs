//! The commands of the guide to materials, run one after another as a reader runs them.

use std::fs;
use std::path::Path;

use crate::support::Program;
use elm_datasets::{paint, scattered};

/// The blocks of a language in a Markdown text.
fn blocks<'a>(text: &'a str, language: &str) -> Vec<&'a str> {
    let start = format!("```{language}\n");
    let parts = text.split(start.as_str()).skip(1);
    parts.filter_map(|part| part.split("```").next()).collect()
}

/// The words of a command line; double quotes keep words together.
fn words(line: &str) -> Vec<String> {
    let parts = line.split('"').enumerate();
    parts
        .flat_map(|(index, part)| match index % 2 {
            0 => part.split_whitespace().map(str::to_owned).collect(),
            _ => vec![part.to_owned()],
        })
        .collect()
}

#[test]
fn every_command_of_the_guide_to_materials_succeeds() {
    let guide = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/guides/materials.md");
    let text = fs::read_to_string(guide).unwrap();
    let dir = tempfile::tempdir().unwrap();
    for (name, rows, seed) in [
        ("paint.csv", 200, 1),
        ("other.csv", 50, 2),
        ("directions.csv", 50, 3),
    ] {
        let samples = paint::samples(rows, seed).unwrap();
        scattered::write(dir.path().join(name), &samples).unwrap();
    }
    let scene = blocks(&text, "toml")[0];
    fs::write(dir.path().join("scene.toml"), scene).unwrap();

    let program = Program::new();
    let mut run = 0;
    for line in blocks(&text, "sh").into_iter().flat_map(str::lines) {
        let words = words(line);
        assert_eq!(words[0], "elm-brdf", "{line}");
        let mut command = program.command();
        command.current_dir(dir.path()).args(&words[1..]);
        command.assert().success();
        run += 1;
    }
    assert_eq!(run, 11);
    for written in [
        "paint.elm",
        "paint.glsl",
        "paint.binary",
        "sphere.png",
        "sheet.png",
    ] {
        assert!(dir.path().join(written).is_file(), "{written}");
    }
}
