//! Extreme learning machines in SQL, on [DataFusion](datafusion): `elm_fit`, an aggregate whose value is a
//! fitted network, and `elm_predict`, which applies networks to rows. The program `elm` is built on them.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # tokio::runtime::Runtime::new()?.block_on(async {
//! use datafusion::prelude::SessionContext;
//!
//! let context = SessionContext::new();
//! elm_datafusion::register(&context)?;
//! context.sql("SET elm.neurons = 50").await?;
//! let rows = context
//!     .sql("WITH rows AS (SELECT value * 0.01 AS x FROM generate_series(1, 500)),
//!                model AS (SELECT elm_fit(sin(x), x) AS model FROM rows)
//!           SELECT max(abs(elm_predict(model, x) - sin(x))) < 0.001 FROM rows CROSS JOIN model")
//!     .await?
//!     .collect()
//!     .await?;
//! # assert!(datafusion::arrow::util::pretty::pretty_format_batches(&rows)?.to_string().contains("true"));
//! # Ok(())
//! # })
//! # }
//! ```
//!
//! # Which rows the layer is drawn for
//! A network's random layer needs to know means and deviations of its inputs, and states of different
//! partitions can be merged if they share a layer. Hence two ways, chosen by the number of rows alone, never
//! by how the rows are dealt to partitions:
//! - a group of at most `elm.group_rows` rows is kept as rows and fitted when it is complete, with means and
//!   deviations of its own, as [`ElmParams::fit_dataset`](elm::ElmParams::fit_dataset) does;
//! - a larger one is an [`Accumulator`](elm::Accumulator), whose layer is drawn for the [`Sample`] that a
//!   first pass over all rows gives: [`sql`] runs it where there is no GROUP BY.
//!
//! Either way the model is the same, to condition times epsilon, for any number and order of partitions.

pub mod cluster;
mod columns;
mod error;
mod fit;
mod options;
mod predict;
mod sample;
mod settings;
mod sql;
mod state;
mod table_model;

use datafusion::error::Result;
use datafusion::logical_expr::{AggregateUDF, ScalarUDF};
use datafusion::prelude::{SessionConfig, SessionContext};

pub use columns::Nulls;
pub use fit::ElmFit;
pub use options::ElmOptions;
pub use predict::ElmPredict;
pub use sample::{ElmSample, Sample};
pub use settings::Settings;
pub use sql::{first_pass, sql, statements};
pub use table_model::{Columns, Feature, TableModel};

/// Adds the functions `elm_fit`, `elm_sample`, `elm_predict` and `elm_predict_all`, and the options `elm.*`
/// ([`ElmOptions`]), to a session.
///
/// # Errors
/// None today; those of the session.
pub fn register(context: &SessionContext) -> Result<()> {
    let state = context.state_ref();
    {
        let mut state = state.write();
        let extensions = &mut state.config_mut().options_mut().extensions;
        extensions.insert(ElmOptions::default());
    }
    register_functions(context);
    Ok(())
}

/// A configuration under which files alone say which rows each of `partitions` partitions has, and not which
/// partition is idle: models have the same bits in every run.
#[must_use]
pub fn with_fixed_partitions(config: SessionConfig, partitions: usize) -> SessionConfig {
    let mut config = config
        .with_target_partitions(partitions)
        .with_round_robin_repartition(false)
        // Smaller files are not split.
        .with_repartition_file_min_size(1 << 20);
    let execution = &mut config.options_mut().execution;
    execution.enable_file_stream_work_stealing = false;
    config
}

/// As [`register`], without options.
pub fn register_functions(context: &SessionContext) {
    context.register_udaf(AggregateUDF::from(ElmFit::unbound()));
    context.register_udaf(AggregateUDF::from(ElmSample::unbound()));
    context.register_udf(ScalarUDF::from(ElmPredict::one()));
    context.register_udf(ScalarUDF::from(ElmPredict::all()));
}
