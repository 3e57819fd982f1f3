//! A Python environment of its own for the peers, set up on the first run.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const REQUIREMENTS: &str = include_str!("../../peers/requirements.txt");
const OPTIONAL: &str = include_str!("../../peers/requirements-optional.txt");

/// Why there is no environment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Trouble {
    /// No interpreter, or none that is new enough.
    NoPython(String),
    /// The interpreter cannot make environments, or has no pip.
    NoPip(String),
    /// A package did not install.
    Install(String),
    /// A folder could not be written.
    Folder(String),
}

impl std::fmt::Display for Trouble {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoPython(tried) => write!(
                f,
                "no Python 3.11 or later (tried {tried}); install one or name it with --python"
            ),
            Self::NoPip(why) => write!(
                f,
                "Python cannot set up an environment with pip ({why}); on Debian and Ubuntu \
                 install python3-venv"
            ),
            Self::Install(why) => write!(f, "pip could not install the peers ({why})"),
            Self::Folder(why) => write!(f, "the environment's folder cannot be written ({why})"),
        }
    }
}

impl std::error::Error for Trouble {}

/// A folder with an interpreter that has the peers.
#[derive(Debug, Clone)]
pub struct Environment {
    /// The interpreter.
    pub python: PathBuf,
    /// Optional packages that did not install.
    pub left_out: Vec<String>,
}

impl Environment {
    /// The environment in `folder`, set up anew where it is not there or is of other versions.
    ///
    /// # Errors
    /// [`Trouble`], which says what to install.
    pub fn set_up(folder: &Path, python: Option<&str>) -> Result<Self, Trouble> {
        let bin = if cfg!(windows) { "Scripts" } else { "bin" };
        let own = folder.join(bin).join("python");
        let stamp = folder.join("installed.txt");
        let wanted = format!("{REQUIREMENTS}{OPTIONAL}");
        if let Ok(found) = fs::read_to_string(&stamp)
            && let Some(left_out) = found.strip_prefix(&wanted)
            && runs(&own)
        {
            return Ok(Self {
                python: own,
                left_out: left_out.lines().map(str::to_owned).collect(),
            });
        }
        let python = find(python)?;
        let made = output(
            Command::new(&python)
                .args(["-m", "venv", "--clear"])
                .arg(folder),
        );
        made.map_err(Trouble::NoPip)?;
        let pip = |what: &[&str]| {
            let mut command = Command::new(&own);
            command.args(["-m", "pip"]).args(what);
            output(&mut command)
        };
        pip(&["--version"]).map_err(Trouble::NoPip)?;
        let install = |packages: &[&str]| {
            pip(&[&["install", "--quiet", "--prefer-binary"], packages].concat())
        };
        let needed: Vec<&str> = packages(REQUIREMENTS).collect();
        install(&needed).map_err(Trouble::Install)?;
        let left_out: Vec<String> = packages(OPTIONAL)
            .filter(|package| install(&[package]).is_err())
            .map(str::to_owned)
            .collect();
        fs::write(&stamp, format!("{wanted}{}", left_out.join("\n")))
            .map_err(|error| Trouble::Folder(error.to_string()))?;
        Ok(Self {
            python: own,
            left_out,
        })
    }
}

fn packages(requirements: &str) -> impl Iterator<Item = &str> {
    requirements
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
}

fn find(named: Option<&str>) -> Result<String, Trouble> {
    let candidates: Vec<&str> = named.map_or_else(|| vec!["python3", "python"], |name| vec![name]);
    let recent = "import sys; sys.exit(sys.version_info < (3, 11))";
    candidates
        .iter()
        .find(|python| output(Command::new(python).args(["-c", recent])).is_ok())
        .map(|&python| python.to_owned())
        .ok_or_else(|| Trouble::NoPython(candidates.join(", ")))
}

fn runs(python: &Path) -> bool {
    output(Command::new(python).args(["-c", "import numpy, scipy, sklearn"])).is_ok()
}

/// Runs a command; where it fails, the last line of what it said.
fn output(command: &mut Command) -> Result<(), String> {
    let done = command.stdin(Stdio::null()).output();
    let done = done.map_err(|error| error.to_string())?;
    if done.status.success() {
        return Ok(());
    }
    let said = [done.stderr, done.stdout].concat();
    let said = String::from_utf8_lossy(&said);
    let last = said.lines().rev().find(|line| !line.trim().is_empty());
    Err(last.unwrap_or("no message").trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_interpreter_is_named() {
        let error = Environment::set_up(Path::new("nowhere"), Some("no-such-python")).unwrap_err();
        assert_eq!(error, Trouble::NoPython("no-such-python".to_owned()));
        assert!(error.to_string().contains("--python"));
    }

    #[test]
    fn every_package_has_a_version() {
        for package in packages(REQUIREMENTS).chain(packages(OPTIONAL)) {
            assert!(package.contains("=="), "{package}");
        }
    }
}
