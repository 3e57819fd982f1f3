//! What a fit is told, apart from the rows.

use elm::ElmParams;
use serde::{Deserialize, Serialize};

use crate::columns::Nulls;

/// The settings of `elm_fit`, the same for all rows and carried in the function, not in every row.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Of the network.
    pub params: ElmParams<f64>,
    /// How many of the first arguments are targets.
    pub targets: usize,
    /// Whether the argument after the targets is the weight of the row.
    pub weighted: bool,
    /// What becomes of rows with a NULL.
    pub nulls: Nulls,
    /// Groups of at most this many rows are kept as rows.
    pub group_rows: usize,
    /// Whether a group that cannot be fitted has NULL for a model.
    pub null_on_failure: bool,
}

impl Settings {
    /// These parameters, one target, no weights, NULLs skipped, groups of up to 10,000 rows as rows.
    #[must_use]
    pub fn new(params: ElmParams<f64>) -> Self {
        Self {
            params,
            targets: 1,
            weighted: false,
            nulls: Nulls::Skip,
            group_rows: 10_000,
            null_on_failure: false,
        }
    }

    /// Arguments before the inputs.
    pub(crate) fn leading(&self) -> usize {
        self.targets.saturating_add(usize::from(self.weighted))
    }
}
