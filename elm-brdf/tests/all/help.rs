//! Help texts, word for word: a change to one is seen when it is reviewed.

use crate::support::Program;

/// Every subcommand, with those of its own.
const COMMANDS: [&str; 14] = [
    "",
    "reproduce",
    "compare",
    "pareto",
    "fit",
    "eval",
    "predict",
    "info",
    "prior",
    "prior build",
    "render",
    "export",
    "gallery",
    "fetch curet",
];

fn help(command: &str) -> String {
    let mut program = Program::new().command();
    let program = program
        .env("COLUMNS", "100")
        .args(command.split_whitespace());
    let output = program
        .arg("--help")
        .assert()
        .success()
        .get_output()
        .clone();
    String::from_utf8(output.stdout).unwrap()
}

/// The commands whose text is the same in this build as in one with `fetch`, which adds a command to
/// the list of the program's own help.
fn reviewed() -> impl Iterator<Item = &'static str> {
    let fetch = cfg!(feature = "fetch");
    COMMANDS
        .into_iter()
        .filter(move |&command| fetch || !matches!(command, "" | "fetch curet"))
}

#[test]
fn help_texts_are_those_reviewed() {
    for command in reviewed() {
        let name = format!("elm-brdf {command}").trim_end().replace(' ', "-");
        insta::with_settings!({ prepend_module_to_snapshot => false, omit_expression => true }, {
            insta::assert_snapshot!(name, help(command));
        });
    }
}

#[test]
fn no_help_line_passes_100_columns() {
    for command in reviewed() {
        for line in help(command).lines() {
            assert!(line.chars().count() <= 100, "{command}: {line}");
        }
    }
}

#[test]
fn the_list_of_commands_here_is_that_of_the_program() {
    let text = help("");
    let commands = text.split("Commands:\n").nth(1).unwrap();
    let commands = commands.split("\n\n").next().unwrap();
    let names = commands
        .lines()
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next());
    for name in names.filter(|&name| name != "help") {
        assert!(
            COMMANDS.iter().any(|c| c.split(' ').next() == Some(name)),
            "{name}"
        );
    }
}
