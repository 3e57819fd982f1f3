//! Runs other programs in the workspace's root, and reads what tests print while they run.

use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc::{self, Sender};

use crate::Result;

/// The workspace's root folder.
pub(crate) fn root() -> PathBuf {
    let xtask = Path::new(env!("CARGO_MANIFEST_DIR"));
    xtask.parent().unwrap_or(xtask).to_path_buf()
}

/// Prints one line on standard error.
pub(crate) fn say(line: &str) {
    // Nothing can be done about a closed standard error.
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// A program with its arguments, separated by spaces, in the root folder.
pub(crate) fn command(line: &str) -> Command {
    let mut words = line.split_whitespace();
    let name = words.next().unwrap_or_default();
    // The toolchain's own cargo, which runs this program.
    let cargo = std::env::var_os("CARGO").filter(|_| name == "cargo");
    let mut command = Command::new(cargo.unwrap_or_else(|| name.into()));
    command.args(words).current_dir(root());
    command
}

/// With clippy for a compiler and warnings as errors: what is tested is built once.
pub(crate) fn linted(mut command: Command) -> Command {
    command.env("RUSTC_WORKSPACE_WRAPPER", "clippy-driver");
    command.env("RUSTFLAGS", "-D warnings");
    command
}

fn shown(command: &Command) -> String {
    let name = Path::new(command.get_program()).file_stem();
    let arguments = command.get_args();
    name.into_iter()
        .chain(arguments)
        .map(|word| word.to_string_lossy())
        .collect::<Vec<_>>()
        .join(" ")
}

/// Runs a command to its end.
///
/// # Errors
/// When it cannot be started, and when it fails.
pub(crate) fn run(mut command: Command) -> Result {
    let shown = shown(&command);
    say(&format!("$ {shown}"));
    let status = command
        .status()
        .map_err(|error| format!("{shown}: {error}"))?;
    if status.success() {
        Ok(())
    } else {
        Err(format!("failed: {shown}"))
    }
}

/// How many tests passed, failed and were ignored, by the harness's own counts, and what tests
/// said that they skipped.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) passed: usize,
    pub(crate) failed: usize,
    pub(crate) ignored: usize,
    pub(crate) skipped: Vec<String>,
}

impl Counts {
    fn read(&mut self, line: &str) {
        if let Some(at) = line.find("skipped: ") {
            self.skipped.push(line[at..].to_owned());
        }
        // test result: ok. 3 passed; 0 failed; 1 ignored; 0 measured; 0 filtered out; ...
        let Some((_, counts)) = line.split_once("test result: ") else {
            return;
        };
        let words: Vec<&str> = counts.split_whitespace().collect();
        for pair in words.windows(2) {
            let number = pair[0].parse().unwrap_or(0);
            match pair[1] {
                "passed;" => self.passed += number,
                "failed;" => self.failed += number,
                "ignored;" => self.ignored += number,
                _ => {}
            }
        }
    }
}

/// Runs `cargo test`, passes on what it prints, and counts.
///
/// # Errors
/// When it cannot be started, and when a test fails.
pub(crate) fn test(mut command: Command) -> Result<Counts> {
    let shown = shown(&command);
    say(&format!("$ {shown}"));
    let mut child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| format!("{shown}: {error}"))?;
    let (send, lines) = mpsc::channel();
    if let Some(stream) = child.stdout.take() {
        forward(stream, false, send.clone());
    }
    if let Some(stream) = child.stderr.take() {
        forward(stream, true, send);
    }
    let mut counts = Counts::default();
    for (line, is_error) in lines {
        if is_error {
            say(&line);
        } else {
            println!("{line}");
        }
        counts.read(&line);
    }
    let status = child.wait().map_err(|error| format!("{shown}: {error}"))?;
    if status.success() {
        Ok(counts)
    } else {
        Err(format!("{} tests failed: {shown}", counts.failed))
    }
}

fn forward(stream: impl Read + Send + 'static, is_error: bool, send: Sender<(String, bool)>) {
    std::thread::spawn(move || {
        for line in BufReader::new(stream).split(b'\n') {
            let Ok(line) = line else { return };
            let line = String::from_utf8_lossy(&line).into_owned();
            if send.send((line, is_error)).is_err() {
                return;
            }
        }
    });
}

#[test]
fn counts_are_summed_over_test_programs_and_skipped_tests_are_kept() {
    let mut counts = Counts::default();
    for line in [
        "test result: ok. 3 passed; 0 failed; 1 ignored; 0 measured; 2 filtered out; finished in 1s",
        "test result: FAILED. 4 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out",
        "skipped: real needs CUReT's files",
        "test a ... skipped: a needs Chromium",
    ] {
        counts.read(line);
    }
    let skipped = [
        "skipped: real needs CUReT's files",
        "skipped: a needs Chromium",
    ];
    let skipped = skipped.map(str::to_owned).to_vec();
    let expected = Counts {
        passed: 7,
        failed: 2,
        ignored: 1,
        skipped,
    };
    assert_eq!(counts, expected);
}
