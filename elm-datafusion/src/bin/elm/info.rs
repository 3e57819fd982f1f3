//! `elm info`.

use std::path::PathBuf;

use clap::Args;

use crate::failure::Failure;
use crate::models::Models;
use crate::query::print;

/// Arguments of `elm info`.
#[derive(Debug, Args)]
pub(crate) struct Info {
    /// What `elm fit` wrote
    model: PathBuf,
}

impl Info {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let models = Models::load(&self.model)?;
        let columns = models.columns();
        print(&format!("targets   {}", columns.targets.join(", ")))?;
        for (number, feature) in columns.features.iter().enumerate() {
            let head = if number == 0 { "features" } else { "" };
            let kind = match &feature.categories {
                None => "number".to_owned(),
                Some(categories) => format!("text: {}", categories.join(", ")),
            };
            print(&format!("{head:<9} {} ({kind})", feature.name))?;
        }
        print(&format!(
            "rows      {} ({} with NULL skipped)",
            columns.rows, columns.skipped
        ))?;
        match &models {
            Models::One(model) => {
                let network = &model.model;
                let diagnosis = network.diagnosis();
                print(&format!("neurons   {}", network.hidden().neurons()))?;
                let lambda: Vec<String> = diagnosis
                    .lambda
                    .iter()
                    .map(|lambda| format!("{lambda:.3e}"))
                    .collect();
                print(&format!("lambda    {}", lambda.join(", ")))
            }
            Models::Groups { count, columns, .. } => print(&format!(
                "groups    {count}, by {}",
                columns.groups.join(", ")
            )),
        }
    }
}
