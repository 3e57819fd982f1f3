//! What people who measure bring to the program, as they run it.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use crate::support::Program;
use serde_json::Value;
use tempfile::TempDir;

/// A folder, and the program to run in it.
struct Bench {
    program: Program,
    dir: TempDir,
}

impl Bench {
    fn new() -> Self {
        Self {
            program: Program::new(),
            dir: tempfile::tempdir().unwrap(),
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    /// Standard output and standard error of a run that succeeds.
    fn run(&self, arguments: &[&str]) -> (String, String) {
        let assert = self
            .program
            .command()
            .current_dir(self.dir.path())
            .args(arguments)
            .assert()
            .success();
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
        (
            text(&assert.get_output().stdout),
            text(&assert.get_output().stderr),
        )
    }

    /// The one line of a run that fails.
    fn refused(&self, arguments: &[&str]) -> String {
        let assert = self
            .program
            .command()
            .current_dir(self.dir.path())
            .args(arguments)
            .assert()
            .failure();
        let text = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
        assert_eq!(text.lines().count(), 1, "{arguments:?}: {text}");
        text
    }

    fn rmse(&self, model: &str, samples: &str, more: &[&str]) -> f64 {
        let (text, _) = self.run(&[&["eval", model, samples, "--format", "json"], more].concat());
        let found: Value = serde_json::from_str(&text).unwrap();
        found["metrics"]["rmse"].as_f64().unwrap()
    }
}

/// A diffuse material with a soft highlight; its angles in degrees.
fn brdf(theta_i: f64, phi_i: f64, theta_o: f64, phi_o: f64) -> f64 {
    let (i, o) = (theta_i.to_radians(), theta_o.to_radians());
    let phi = (phi_o - phi_i).to_radians();
    let sum = 2.0 + 2.0 * (i.cos() * o.cos() + i.sin() * o.sin() * phi.cos());
    let cos_h = (i.cos() + o.cos()) / sum.sqrt();
    0.1 + 0.3 * (-8.0 * (1.0 - cos_h)).exp()
}

fn grid() -> Vec<[f64; 4]> {
    let mut rows = Vec::new();
    for theta_i in [0.0, 20.0, 40.0, 60.0, 75.0] {
        for theta_o in 0..9 {
            for phi_o in [0.0, 60.0, 120.0, 180.0] {
                rows.push([theta_i, 0.0, f64::from(theta_o) * 10.0, phi_o]);
            }
        }
    }
    rows
}

/// A table of the grid in degrees with these columns, each a factor on the material.
fn table(columns: &[(&str, f64)]) -> String {
    let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
    let mut text = format!("theta_i,phi_i,theta_o,phi_o,{}\n", names.join(","));
    for [a, b, c, d] in grid() {
        write!(text, "{a},{b},{c},{d}").unwrap();
        for (_, factor) in columns {
            write!(text, ",{:.6}", factor * brdf(a, b, c, d)).unwrap();
        }
        text.push('\n');
    }
    text
}

/// Red, green and blue in the middle of a picture.
fn middle(picture: &Path) -> [u8; 3] {
    let picture = image::open(picture).unwrap().to_rgb8();
    picture
        .get_pixel(picture.width() / 2, picture.height() / 2)
        .0
}

const SCENE: &str = "[image]\nwidth = 16\nheight = 16\nsamples = 4\n\
    [camera]\nposition = [0, 0, 6]\ntarget = [0, 0, 0]\nfov = 22\n\
    [[sphere]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = 'm'\n\
    [environment]\nradiance = [1, 1, 1]\nvisible = false\n\
    [material.m]\n";

#[test]
fn channels_are_matched_by_name_and_wavelength_by_every_command() {
    let bench = Bench::new();
    bench.write("rgb.csv", &table(&[("r", 1.0), ("g", 0.5), ("b", 0.1)]));
    bench.write(
        "bgr.csv",
        &table(&[("Blue", 0.1), ("Green", 0.5), ("Red", 1.0)]),
    );
    let nm = [("450 nm", 0.1), ("550 nm", 0.5), ("650 nm", 1.0)];
    bench.write("nm.csv", &table(&nm));
    for name in ["rgb", "bgr", "nm"] {
        let (csv, model) = (format!("{name}.csv"), format!("{name}.elm"));
        bench.run(&["fit", &csv, "-o", &model, "--degrees", "--neurons", "60"]);
        for other in ["rgb.csv", "bgr.csv", "nm.csv"] {
            let rmse = bench.rmse(&model, other, &["--degrees"]);
            assert!(rmse < 0.02, "{name} {other}: {rmse}");
        }
        for (number, material) in [
            format!("model = '{model}'\n"),
            format!("csv = '{csv}'\ndegrees = true\n"),
        ]
        .iter()
        .enumerate()
        {
            let (scene, picture) = (format!("{number}.toml"), format!("{name}{number}.png"));
            bench.write(&scene, &format!("{SCENE}{material}"));
            bench.run(&["render", &scene, "-o", &picture]);
            let [r, g, b] = middle(&bench.path(&picture));
            assert!(r > g && g > b, "{material}: {r} {g} {b}");
        }
        let table = format!("{name}.binary");
        bench.run(&["export", &model, "-o", &table]);
        let merl = elm_datasets::merl::Merl::read(bench.path(&table)).unwrap();
        let [r, g, b] = merl.at(&elm_datasets::DirectionPair::from(elm_datasets::Angles {
            theta_i: 0.3,
            phi_i: 0.0,
            theta_o: 0.5,
            phi_o: 2.0,
        }));
        assert!(r > g && g > b, "{name}: {r} {g} {b}");
    }
    // C has the same weights in the same order whatever the file's.
    bench.run(&["export", "rgb.elm", "-o", "rgb.c"]);
    bench.run(&["export", "bgr.elm", "-o", "bgr.c"]);
    let same = |name: &str| fs::read_to_string(bench.path(name)).unwrap();
    assert_eq!(same("rgb.c").lines().count(), same("bgr.c").lines().count());

    bench.write("one.csv", &table(&[("450 nm", 0.1)]));
    let error = bench.refused(&["eval", "rgb.elm", "one.csv", "--degrees"]);
    assert!(
        error.contains("r, g, b") && error.contains("450 nm"),
        "{error}"
    );
}

#[test]
fn columns_that_are_no_reflectance_need_a_word() {
    let bench = Bench::new();
    bench.write("std.csv", &table(&[("brdf", 1.0), ("brdf_std", 0.01)]));
    for command in [
        &["fit", "std.csv", "-o", "m.elm", "--degrees"][..],
        &["compare", "std.csv", "--degrees", "--models", "lambert"],
        &["export", "csv:std.csv", "-o", "m.c", "--degrees"],
        &[
            "pareto",
            "--samples",
            "std.csv",
            "--degrees",
            "--models",
            "lambert",
            "-o",
            "out",
        ],
    ] {
        let error = bench.refused(command);
        assert!(
            error.contains("brdf_std") && error.contains("--ignore"),
            "{error}"
        );
    }
    let fit = [
        "fit",
        "std.csv",
        "-o",
        "m.elm",
        "--degrees",
        "--neurons",
        "40",
    ];
    let (said, _) = bench.run(&[&fit[..], &["--ignore", "brdf_std"]].concat());
    assert!(said.contains("channels brdf\n"), "{said}");
    let (said, _) = bench.run(&[&fit[..], &["--channels", "brdf"]].concat());
    assert!(said.contains("channels brdf\n"), "{said}");
    bench.write(
        "scene.toml",
        &format!("{SCENE}csv = 'std.csv'\ndegrees = true\n"),
    );
    let error = bench.refused(&["render", "scene.toml", "-o", "a.png"]);
    assert!(error.contains("brdf_std"), "{error}");
    bench.write(
        "scene.toml",
        &format!("{SCENE}csv = 'std.csv'\ndegrees = true\nignore = ['brdf_std']\n"),
    );
    bench.run(&["render", "scene.toml", "-o", "a.png"]);
}

#[test]
fn one_reader_serves_every_command() {
    let bench = Bench::new();
    bench.write("degrees.csv", &table(&[("brdf", 1.0)]));
    bench.write("scene.toml", &format!("{SCENE}csv = 'degrees.csv'\n"));
    for command in [
        &["fit", "degrees.csv", "-o", "m.elm"][..],
        &["export", "csv:degrees.csv", "-o", "m.c"],
        &["render", "scene.toml", "-o", "a.png"],
        &["compare", "degrees.csv", "--models", "lambert"],
    ] {
        let error = bench.refused(command);
        assert!(
            error.contains("--degrees") && error.contains("degrees.csv"),
            "{error}"
        );
    }
    bench.run(&["export", "csv:degrees.csv", "-o", "m.glsl", "--degrees"]);
    let mut text = "theta_i,phi_i,theta_o,phi_o,brdf\n".to_owned();
    for row in grid() {
        let [a, b, c, d] = row.map(f64::to_radians);
        let value = brdf(row[0], row[1], row[2], row[3]);
        writeln!(text, "{a:.4},{b:.4},{c:.4},{d:.4},{value}").unwrap();
    }
    bench.write("radians.csv", &text);
    let error = bench.refused(&["fit", "radians.csv", "-o", "m.elm", "--degrees"]);
    assert!(error.contains("--degrees"), "{error}");
    assert!(!bench.path("m.elm").exists());
}

#[test]
fn what_was_missing_or_assumed_is_said() {
    let bench = Bench::new();
    let mut text = table(&[("brdf", 1.0)]);
    text += "20,0,20,180,-999\n20,0,30,0,-999\n40,0,40,180,NaN\n40,0,-40,0,0.15\n40,0,120,0,5\n";
    bench.write("a.csv", &text);
    let fit = [
        "fit",
        "a.csv",
        "-o",
        "m.elm",
        "--degrees",
        "--neurons",
        "60",
    ];
    let (said, notes) = bench.run(&fit);
    assert!(
        said.contains("3 values missing (no number, or -999)")
            && said.contains("3 measurements left out"),
        "{said}"
    );
    for part in [
        "1 polar angles are negative",
        "1 rows have the viewer below",
    ] {
        assert!(notes.contains(part), "{notes}");
    }
    bench.write("clean.csv", &table(&[("brdf", 1.0)]));
    assert!(bench.rmse("m.elm", "clean.csv", &["--degrees"]) < 0.02);
    // Of a file without any the count is printed too.
    let (said, notes) = bench.run(&["eval", "m.elm", "clean.csv", "--degrees"]);
    assert!(said.contains("0 values missing, 0 negative;"), "{said}");
    assert_eq!(notes, "");
    let zero = table(&[("brdf", 1.0)]) + "40,0,40,90,0\n";
    bench.write("zero.csv", &zero);
    let (said, _) = bench.run(&["eval", "m.elm", "zero.csv", "--degrees"]);
    assert!(said.contains("0 measurements left out; 1 of "), "{said}");
}

#[test]
fn no_command_writes_over_what_it_reads() {
    let bench = Bench::new();
    let text = table(&[("brdf", 1.0)]);
    bench.write("a.csv", &text);
    bench.write("pareto.csv", &text);
    bench.write("m.toml", &format!("{SCENE}csv = 'a.csv'\ndegrees = true\n"));
    let fit = ["fit", "a.csv", "--degrees", "--neurons", "20"];
    bench.run(&[&fit[..], &["-o", "m.elm"]].concat());
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("a.csv", bench.path("link.elm")).unwrap();
        fs::hard_link(bench.path("a.csv"), bench.path("hard.elm")).unwrap();
        bench.refused(&[&fit[..], &["-o", "link.elm"]].concat());
        bench.refused(&[&fit[..], &["-o", "hard.elm"]].concat());
    }
    for command in [
        &["fit", "a.csv", "--degrees", "-o", "a.csv"][..],
        &["fit", "a.csv", "--degrees", "-o", "./a.csv"],
        &[
            "fit",
            "a.csv",
            "--degrees",
            "--prior",
            "m.elm",
            "-o",
            "m.elm",
        ],
        &["export", "m.elm", "-o", "m.elm", "--format", "c"],
        &[
            "export",
            "csv:a.csv",
            "--degrees",
            "-o",
            "a.csv",
            "--format",
            "c",
        ],
        &["render", "m.toml", "-o", "a.png", "--account", "a.csv"],
        &["render", "m.toml", "-o", "a.png", "--account", "m.toml"],
        &["render", "m.toml", "-o", "a.png", "--account", "a.png"],
        &[
            "pareto",
            "--samples",
            "pareto.csv",
            "--degrees",
            "--models",
            "lambert",
            "-o",
            ".",
        ],
    ] {
        let error = bench.refused(command);
        assert!(
            error.contains("name another output") || error.contains("different"),
            "{error}"
        );
    }
    for name in ["a.csv", "pareto.csv"] {
        assert_eq!(fs::read_to_string(bench.path(name)).unwrap(), text);
    }
}

#[test]
fn a_merl_table_of_a_model_that_is_not_reciprocal_holds_the_mean_and_says_so() {
    let bench = Bench::new();
    let mut text = "theta_i,phi_i,theta_o,phi_o,brdf\n".to_owned();
    for [a, b, c, d] in grid() {
        writeln!(
            text,
            "{a},{b},{c},{d},{}",
            brdf(a, b, c, d) * (1.0 + a / 90.0)
        )
        .unwrap();
    }
    bench.write("a.csv", &text);
    let fit = [
        "fit",
        "a.csv",
        "-o",
        "m.elm",
        "--degrees",
        "--neurons",
        "60",
    ];
    bench.run(&[&fit[..], &["--features", "cosines"]].concat());
    let (_, said) = bench.run(&["export", "m.elm", "-o", "m.binary"]);
    assert!(said.contains("mean of both orders"), "{said}");
    bench.run(&[&fit[..], &["--features", "half-diff"]].concat());
    let (_, said) = bench.run(&["export", "m.elm", "-o", "m.binary"]);
    assert_eq!(said, "");
}

#[test]
#[ignore = "needs a C compiler"]
fn headers_can_be_included_twice() {
    let Some(cc) = elm_test_support::program("cc") else {
        return;
    };
    let bench = Bench::new();
    bench.write("a.csv", &table(&[("brdf", 1.0)]));
    bench.run(&[
        "fit",
        "a.csv",
        "-o",
        "m.elm",
        "--degrees",
        "--neurons",
        "20",
    ]);
    bench.run(&["export", "m.elm", "-o", "m.h", "--name", "paint"]);
    let text = fs::read_to_string(bench.path("m.h")).unwrap();
    assert!(
        text.starts_with("#ifndef PAINT_EVAL_H\n#define PAINT_EVAL_H\n"),
        "{text}"
    );
    bench.write(
        "main.c",
        "#include \"m.h\"\n#include \"m.h\"\nint other(void);\n\
         int main(void) { float n[3] = {0, 0, 1}, rgb[3]; paint_eval(n, n, rgb); return other(); }\n",
    );
    bench.write(
        "other.c",
        "#include \"m.h\"\nint other(void) { float n[3] = {0, 0, 1}, rgb[3]; \
         paint_eval(n, n, rgb); return rgb[0] > 0.1f ? 0 : 1; }\n",
    );
    let status = std::process::Command::new(cc)
        .args([
            "-std=c99", "-Wall", "-Wextra", "-Werror", "main.c", "other.c", "-lm", "-o", "main",
        ])
        .current_dir(bench.dir.path())
        .status()
        .unwrap();
    assert!(status.success());
    let run = std::process::Command::new(bench.path("main"))
        .status()
        .unwrap();
    assert!(run.success());
}

#[test]
fn every_model_that_compare_prints_can_be_selected() {
    let bench = Bench::new();
    bench.write("a.csv", &table(&[("brdf", 1.0)]));
    let names = [
        "nearest (paper, identity)",
        "elm (200 sine, ridge)",
        "lambert",
        "inverse-distance-5 (cosines, log)",
    ];
    let list = names.join(", ");
    let compare = ["compare", "a.csv", "--degrees", "--folds", "3", "--models"];
    let (text, _) = bench.run(&[&compare[..], &[&list, "--format", "json"]].concat());
    let found: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(
        found["models"].as_array().unwrap().len(),
        names.len(),
        "{text}"
    );
}
