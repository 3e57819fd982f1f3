//! The program as a user runs it, away from this machine's own data.

use std::path::PathBuf;

use assert_cmd::Command;
use tempfile::TempDir;

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

    /// Standard output of a successful run with these arguments.
    pub(crate) fn output(&self, arguments: &[&str]) -> String {
        let assert = self.command().args(arguments).assert().success().stderr("");
        String::from_utf8(assert.get_output().stdout.clone()).unwrap()
    }
}
