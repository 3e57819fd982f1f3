//! Packages as they would be published, in the order in which they can be.

use clap::Args;

use crate::Result;
use crate::run::{command, run};

/// Every package that is published, each after those that it depends on.
const ORDER: [&str; 4] = ["elm-datasets", "elm-learn", "elm-brdf-render", "elm-brdf"];

/// How to package.
#[derive(Args, Clone, Copy, Default)]
pub(crate) struct Packaging {
    /// Also with changes that are not committed.
    #[arg(long)]
    allow_dirty: bool,
    /// Without building each package from what it contains.
    #[arg(long)]
    no_verify: bool,
}

impl Packaging {
    /// What the packages contain, which takes seconds; building them takes as long as the workspace.
    pub(crate) fn contents() -> Self {
        Self {
            no_verify: true,
            ..Self::default()
        }
    }

    pub(crate) fn run(self) -> Result {
        // In one call: a package finds the others of the call, which no registry has yet.
        let mut cargo = command("cargo package --locked");
        for name in ORDER {
            cargo.args(["-p", name]);
        }
        if self.allow_dirty {
            cargo.arg("--allow-dirty");
        }
        if self.no_verify {
            cargo.arg("--no-verify");
        }
        run(cargo)
    }
}
