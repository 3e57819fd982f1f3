//! The options of a session, `SET elm.neurons = 200`.

use datafusion::common::extensions_options;
use datafusion::config::{ConfigExtension, ConfigOptions};
use datafusion::error::Result;
use elm::solve::Ridge;
use elm::{Activation, ElmParams};

use crate::columns::Nulls;
use crate::error::unplanned;
use crate::settings::Settings;

extensions_options! {
    /// What `elm_fit` and `elm_sample` are told by `SET elm.NAME = VALUE`; `SHOW ALL` lists them.
    pub struct ElmOptions {
        /// Hidden neurons, at least 1
        pub neurons: usize, default = 100
        /// The neurons' function: sigmoid, tanh, relu, gaussian, ...
        pub activation: String, default = "sigmoid".to_owned()
        /// Seed of the random layer
        pub seed: u64, default = 0
        /// Spread of the random weights, above 0
        pub scale: f64, default = 1.0
        /// Strength of the ridge penalty relative to the largest squared singular value, or 'auto'
        pub lambda: String, default = "auto".to_owned()
        /// How many of the first arguments are targets
        pub targets: usize, default = 1
        /// Whether the argument after the targets is the weight of the row
        pub weighted: bool, default = false
        /// Rows with a NULL among the arguments: 'skip' or 'error'
        pub nulls: String, default = "skip".to_owned()
        /// Groups of at most this many rows are kept as rows and fitted with a scaling of their own
        pub group_rows: usize, default = 10_000
        /// A first pass over all rows, to scale inputs by: 'auto' (without GROUP BY), 'always' or 'never'
        pub first_pass: String, default = "auto".to_owned()
        /// Groups that cannot be fitted: 'error', or 'null' for no model
        pub failed: String, default = "error".to_owned()
    }
}

impl ConfigExtension for ElmOptions {
    const PREFIX: &'static str = "elm";
}

/// When the first pass over all rows is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FirstPass {
    WithoutGroups,
    Always,
    Never,
}

impl ElmOptions {
    pub(crate) fn of(options: &ConfigOptions) -> Self {
        options
            .extensions
            .get::<Self>()
            .cloned()
            .unwrap_or_default()
    }

    pub(crate) fn first_pass(&self) -> Result<FirstPass> {
        match self.first_pass.as_str() {
            "auto" => Ok(FirstPass::WithoutGroups),
            "always" => Ok(FirstPass::Always),
            "never" => Ok(FirstPass::Never),
            other => Err(bad("first_pass", other, "'auto', 'always' or 'never'")),
        }
    }

    /// The settings that these options ask for.
    ///
    /// # Errors
    /// A planning error that names the option, what it is and what was expected.
    pub fn settings(&self) -> Result<Settings> {
        let activation: Activation<f64> = (self.activation.parse())
            .map_err(|_| bad("activation", &self.activation, Activation::<f64>::NAMES))?;
        let solver = match self.lambda.as_str() {
            "auto" => Ridge::leave_one_out(),
            text => Ridge::relative(
                (text.parse()).map_err(|_| bad("lambda", text, "'auto' or a number"))?,
            ),
        };
        let params = ElmParams::new(self.neurons)
            .with_activation(activation)
            .with_seed(self.seed)
            .with_scale(self.scale)
            .with_solver(solver);
        (params.check()).map_err(|error| unplanned("the options elm.*", error))?;
        if self.targets == 0 {
            return Err(bad("targets", "0", "at least 1"));
        }
        let nulls = match self.nulls.as_str() {
            "skip" => Nulls::Skip,
            "error" => Nulls::Error,
            other => return Err(bad("nulls", other, "'skip' or 'error'")),
        };
        let null_on_failure = match self.failed.as_str() {
            "error" => false,
            "null" => true,
            other => return Err(bad("failed", other, "'error' or 'null'")),
        };
        Ok(Settings {
            params,
            targets: self.targets,
            weighted: self.weighted,
            nulls,
            group_rows: self.group_rows,
            null_on_failure,
        })
    }
}

fn bad(option: &str, value: &str, expected: &str) -> datafusion::error::DataFusionError {
    unplanned(
        &format!("elm.{option} is '{value}'"),
        format!("expected {expected}"),
    )
}
