//! Materials in files of one's own, as a user exports and shows them.

use std::fs;
use std::path::{Path, PathBuf};

use crate::support::Program;
use elm_datasets::lobes::Formula;
use elm_datasets::merl::Merl;

/// A MERL table of a formula, in a folder.
fn table(dir: &Path) -> PathBuf {
    let glossy = Formula::lambert(0.1)
        .and_then(|diffuse| diffuse.with_ggx(0.04, 0.3))
        .unwrap();
    let (merl, _) = elm_brdf::export::merl_table(&glossy).unwrap();
    let path = dir.join("in.binary");
    merl.write(&path).unwrap();
    path
}

#[test]
fn an_exact_export_of_a_table_is_the_table_and_anything_else_is_refused() {
    let (program, dir) = (Program::new(), tempfile::tempdir().unwrap());
    let (input, out) = (table(dir.path()), dir.path().join("out.binary"));
    let paths = [&input, &out].map(|path| path.to_str().unwrap());
    program.output(&["export", paths[0], "-o", paths[1], "--exact"]);
    let (before, after) = (Merl::read(&input).unwrap(), Merl::read(&out).unwrap());
    let pairs = elm_datasets::Sampling::Random {
        rows: 2000,
        seed: 3,
    };
    let ((before, _), (after, _)) = (
        before.samples(&pairs).unwrap(),
        after.samples(&pairs).unwrap(),
    );
    // A cell is looked up at its own centre: the same number, written once more.
    assert_eq!(before.directions, after.directions);
    for (a, b) in before.values.iter().zip(&after.values) {
        assert!((a - b).abs() <= 1e-12 * a.abs(), "{a} {b}");
    }
    fs::write(dir.path().join("x.csv"), "theta_i,theta_o,y\n0.1,0.2,0.5\n").unwrap();
    let csv = dir.path().join("x.csv");
    for (from, to, word) in [
        (csv.to_str().unwrap(), "y.binary", "--exact"),
        ("curet:39", "y.binary", "--exact"),
        (paths[0], "y.glsl", "network"),
    ] {
        let to = dir.path().join(to);
        let command = ["export", from, "-o", to.to_str().unwrap(), "--exact"];
        let (said, _) = program.refusal(&command);
        assert!(said.contains(word) && said.lines().count() == 1, "{said}");
        assert!(!to.exists());
    }
}

#[test]
fn a_table_of_ones_own_is_exported_in_one_command() {
    let (program, dir) = (Program::new(), tempfile::tempdir().unwrap());
    let out = dir.path().join("out.glsl");
    let input = table(dir.path());
    let command = [
        "export",
        input.to_str().unwrap(),
        "-o",
        out.to_str().unwrap(),
    ];
    program.output(&[&command[..], &["--rows", "300"]].concat());
    let text = fs::read_to_string(&out).unwrap();
    assert!(text.contains("elm_eval"), "{text}");
}

#[test]
fn models_and_tables_are_shown_on_a_page_and_in_pictures() {
    let (program, dir) = (Program::new(), tempfile::tempdir().unwrap());
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let input = table(dir.path());
    let input = input.to_str().unwrap();
    let model = path("paint.elm");
    program.output(&[
        "fit",
        input,
        "-o",
        &model,
        "--rows",
        "300",
        "--neurons",
        "20",
    ]);
    program.output(&[
        "gallery",
        &model,
        input,
        "-o",
        &path("page"),
        "--neurons",
        "20",
    ]);
    let page = fs::read_to_string(dir.path().join("page/index.html")).unwrap();
    assert!(page.contains("paint") && page.contains("sphere-02.png"));
    for (number, arguments) in [
        &["render", &model][..],
        &["render", input],
        &["render", "builtin:contact-sheet", "--material", &model],
    ]
    .into_iter()
    .enumerate()
    {
        let picture = path(&format!("{number}.png"));
        let small = ["-o", &picture, "--size", "96x72", "--samples", "1"];
        program.output(&[arguments, &small].concat());
        assert!(fs::metadata(&picture).unwrap().len() > 500);
    }
    // A model is no scene, and has none beside it.
    let command = ["render", &model, "--material", "1", "-o", &path("x.png")];
    program.command().args(command).assert().code(2);
    let command = ["gallery", "none.elm", "-o", &path("other")];
    program.command().args(command).assert().code(1);
    assert!(!dir.path().join("other").exists());
}
