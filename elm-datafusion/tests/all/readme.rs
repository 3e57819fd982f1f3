//! The README's commands, run as written in a folder with its rows.

use std::path::Path;

use crate::program::elm;

/// The commands of the blocks marked `console`: lines that begin with `$`.
fn commands() -> Vec<Vec<String>> {
    let text = include_str!("../../README.md");
    let mut commands = Vec::new();
    for block in text.split("```console").skip(1) {
        let block = block.split("```").next().unwrap_or_default();
        for command in block.split("\n$ ").skip(1) {
            let command = joined(command);
            commands.push(words(&command));
        }
    }
    commands
}

/// A command without its output: it goes on while a quote is open.
fn joined(text: &str) -> String {
    let mut command = String::new();
    for line in text.lines() {
        command += line;
        if command.matches('"').count().is_multiple_of(2) {
            break;
        }
        command.push('\n');
    }
    command
}

/// Split as a shell does, without its other features.
fn words(text: &str) -> Vec<String> {
    let (mut words, mut word, mut quote) = (Vec::new(), String::new(), None);
    for letter in text.chars() {
        match (quote, letter) {
            (Some(open), _) if open == letter => quote = None,
            (None, '"' | '\'') => quote = Some(letter),
            (None, ' ') => words.push(std::mem::take(&mut word)),
            _ => word.push(letter),
        }
    }
    words.push(word);
    words
}

#[test]
fn its_commands_run_as_written() {
    let folder = tempfile::tempdir().unwrap();
    let commands = commands();
    assert!(commands.len() >= 6, "{commands:?}");
    for command in commands {
        assert_eq!(command[0], "elm");
        let arguments: Vec<&str> = command[1..].iter().map(String::as_str).collect();
        let output = elm(folder.path(), &arguments);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{command:?}: {errors}");
    }
    assert!(Path::new(&folder.path().join("models.parquet")).is_file());
}
