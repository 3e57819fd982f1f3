//! The commands that write the tables of docs/reports/.

use std::fs;
use std::process::Stdio;

use clap::Args;

use crate::Result;
use crate::run::{command, root, run, say};

/// Each table's name, where it stands in docs/reports/, and the command that prints it; `{curet}`,
/// `{rgl}`, `{nbrdf}` and `{tables}` stand for the folders of real measurements.
const TABLES: &[(&str, &str, &str)] = &[
    (
        "compare",
        "accuracy.md: CUReT",
        "elm-brdf compare --data {curet} --seeds 5",
    ),
    (
        "reproduce-paper",
        "accuracy.md: the paper's 15 materials",
        "elm-brdf reproduce --model paper --data {curet} --seeds 5",
    ),
    (
        "reproduce-best",
        "accuracy.md: the paper's 15 materials",
        "elm-brdf reproduce --model best --data {curet} --seeds 5",
    ),
    ("few", "accuracy.md: few measurements", "few {curet} 3"),
    (
        "inputs",
        "accuracy.md: reciprocal or not",
        "inputs {curet} 2",
    ),
    ("albedo", "accuracy.md: energy", "albedo {curet} 2"),
    ("auto", "auto.md", "auto --seeds 3"),
    (
        "auto-outside",
        "auto.md: outside the data",
        "auto --outside",
    ),
    ("peers", "benchmarks.md: beside other libraries", "peers"),
    ("limits", "benchmarks.md: the machine's limit", "limits"),
    (
        "pareto",
        "benchmarks.md: reflectance",
        "elm-brdf pareto --samples {rgl}/paper_white_rgb_train.csv --nbrdf {nbrdf} \
         --out target/tables/pareto",
    ),
    (
        "paper-time",
        "benchmarks.md: the whole paper",
        "paper_time {curet}",
    ),
    ("tables", "tables.md", "tables --data {tables} --splits 2"),
    ("growth", "benchmarks.md: growth", "growth"),
    ("accumulate", "benchmarks.md: rows in chunks", "accumulate"),
    ("threads", "benchmarks.md: several threads", "threads 2"),
    (
        "rows",
        "benchmarks.md: many rows in memory",
        "rows --fits relative,leave-one-out,weak,auto",
    ),
    ("paper", "paper.md: what comes out", "paper {curet}"),
    (
        "printed",
        "paper.md: what the printed figures are",
        "printed {curet}",
    ),
    (
        "stability",
        "stability.md: written in place",
        "stress --out docs/reports/stability.md --curve docs/reports/stability.svg",
    ),
    (
        "render-costs",
        "rendering.md: savings",
        "cargo run --release --locked -p elm-brdf --example render_costs -- {curet}",
    ),
    (
        "spheres",
        "rendering.md: RGL spheres",
        "cargo test --release --locked -p elm-brdf --test all rgl_spheres:: -- --ignored --nocapture",
    ),
];

/// Which tables to make.
#[derive(Args)]
pub(crate) struct Selection {
    /// Names of tables, each printed and kept in target/tables/NAME.txt; without any, lists all
    /// with their commands.
    #[arg(value_parser = TABLES.iter().map(|&(name, ..)| name).collect::<Vec<_>>())]
    names: Vec<String>,
}

impl Selection {
    pub(crate) fn run(self) -> Result {
        if self.names.is_empty() {
            for (name, place, line) in TABLES {
                println!("{name}\n    docs/reports/{place}\n    {}", by_cargo(line));
            }
        }
        let asked = |name: &str| self.names.iter().any(|asked| asked == name);
        for (name, _, line) in TABLES.iter().filter(|(name, ..)| asked(name)) {
            make(name, &by_cargo(line))?;
        }
        Ok(())
    }
}

/// The whole command: programs of elm-benches are named alone in the list.
fn by_cargo(line: &str) -> String {
    if line.starts_with("cargo ") {
        return line.to_owned();
    }
    let (program, arguments) = line.split_once(' ').unwrap_or((line, ""));
    let package = match program {
        "elm-brdf" => "elm-brdf".to_owned(),
        _ => format!("elm-benches --bin {program}"),
    };
    let line = format!("cargo run --release --locked -p {package} -- {arguments}");
    line.trim_end_matches([' ', '-']).to_owned()
}

fn make(name: &str, line: &str) -> Result {
    let mut line = line.to_owned();
    for (placeholder, folder) in [
        ("{curet}", elm_test_support::curet as fn() -> _),
        ("{rgl}", || elm_test_support::folder("rgl")),
        ("{nbrdf}", || elm_test_support::folder("nbrdf")),
        ("{tables}", || elm_test_support::folder("tables")),
    ] {
        if line.contains(placeholder) {
            let folder = folder().ok_or(format!("'{name}' needs real measurements"))?;
            line = line.replace(placeholder, &folder.to_string_lossy());
        }
    }
    let dir = root().join("target/tables");
    let path = dir.join(format!("{name}.txt"));
    let error = |error: std::io::Error| format!("{}: {error}", path.display());
    fs::create_dir_all(&dir).map_err(error)?;
    let file = fs::File::create(&path).map_err(error)?;
    let mut cargo = command(&line);
    cargo.stdout(Stdio::from(file));
    run(cargo)?;
    let text = fs::read_to_string(&path).map_err(error)?;
    print!("{text}");
    say(&format!("kept in {}", path.display()));
    Ok(())
}

#[test]
fn commands_are_completed_by_the_package_that_has_the_program() {
    let run = "cargo run --release --locked -p";
    assert_eq!(
        by_cargo("few {curet} 3"),
        format!("{run} elm-benches --bin few -- {{curet}} 3")
    );
    assert_eq!(
        by_cargo("growth"),
        format!("{run} elm-benches --bin growth")
    );
    assert_eq!(
        by_cargo("elm-brdf compare"),
        format!("{run} elm-brdf -- compare")
    );
}

#[test]
fn every_table_stands_in_a_report_that_is_there() {
    for (name, place, _) in TABLES {
        let file = place.split(':').next().unwrap_or_default();
        let path = root().join("docs/reports").join(file);
        assert!(path.is_file(), "{name}: {}", path.display());
    }
}
