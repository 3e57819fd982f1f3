//! The program as a user runs it, away from this machine's own data.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

/// Holds a command's JSON against its schema in docs/.
pub(crate) fn check_schema(command: &str, report: &Value) {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let text = fs::read_to_string(docs.join(format!("{command}.schema.json"))).unwrap();
    let validator = jsonschema::validator_for(&serde_json::from_str(&text).unwrap()).unwrap();
    let errors: Vec<String> = validator
        .iter_errors(report)
        .map(|e| format!("{}: {e}", e.instance_path()))
        .collect();
    assert!(errors.is_empty(), "{errors:#?}");
}

/// The program in an empty environment: no data folder is named and the cache is empty.
pub(crate) struct Program {
    home: TempDir,
}

impl Program {
    pub(crate) fn new() -> Self {
        Self {
            home: tempfile::tempdir().unwrap(),
        }
    }

    pub(crate) fn command(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_elm-brdf"));
        command
            .env_remove("ELM_BRDF_DATA")
            .env("HOME", self.home.path())
            .env("XDG_CACHE_HOME", self.cache())
            .env("LOCALAPPDATA", self.cache());
        command
    }

    /// The user's cache folder.
    pub(crate) fn cache(&self) -> PathBuf {
        self.home.path().join("cache")
    }

    /// What a run with these arguments that fails says on standard error, with nothing on standard output,
    /// and its exit code.
    pub(crate) fn refusal(&self, arguments: &[&str]) -> (String, i32) {
        let assert = self.command().args(arguments).assert().failure().stdout("");
        let output = assert.get_output();
        let said = String::from_utf8(output.stderr.clone()).unwrap();
        (said, output.status.code().unwrap())
    }

    /// Standard output of a successful run with these arguments.
    pub(crate) fn output(&self, arguments: &[&str]) -> String {
        let assert = self.command().args(arguments).assert().success().stderr("");
        String::from_utf8(assert.get_output().stdout.clone()).unwrap()
    }
}
