//! `elm predict` and `elm eval`.

use std::path::PathBuf;

use clap::Args;
use datafusion::arrow::array::{Array, AsArray, RecordBatch};
use datafusion::arrow::datatypes::{DataType, Float64Type, Int64Type};
use datafusion::functions_aggregate::expr_fn::{avg, count, var_pop};
use datafusion::logical_expr::{Expr, cast, col, ident};
use datafusion::prelude::{SessionContext, abs};

use crate::Inputs;
use crate::failure::Failure;
use crate::files::Table;
use crate::models::Models;
use crate::output;
use crate::query::print;

/// Arguments of `elm predict`.
#[derive(Debug, Args)]
pub(crate) struct Predict {
    /// What `elm fit` wrote
    model: PathBuf,
    #[command(flatten)]
    inputs: Inputs,
    /// The name of the column of predictions: NULL where an input is, or where a group has no model
    #[arg(long, default_value = "prediction")]
    column: String,
    /// The file to write: all columns, and the predictions
    #[arg(short, long)]
    output: PathBuf,
}

impl Predict {
    pub(crate) async fn run(self, context: &SessionContext) -> Result<(), Failure> {
        let models = Models::load(&self.model)?;
        let table = Table::open(context, &self.inputs.files).await?;
        check_columns(&models, &table)?;
        let mut selected: Vec<Expr> = table.names().into_iter().map(ident).collect();
        if table.names().contains(&self.column) {
            let reason = "is a column of the table already: choose another by --column";
            return Err(Failure::new(format!("'{}' {reason}", self.column)));
        }
        let (rows, prediction) = models.apply(context, table.rows).await?;
        selected.push(prediction.alias(&self.column));
        let rows = output::save(rows.select(selected)?, &self.output).await?;
        eprintln!("{rows} rows: {}", self.output.display());
        Ok(())
    }
}

/// Arguments of `elm eval`.
#[derive(Debug, Args)]
pub(crate) struct Eval {
    /// What `elm fit` wrote
    model: PathBuf,
    #[command(flatten)]
    inputs: Inputs,
    /// The column of true values; that of the fit unless given
    #[arg(long)]
    target: Option<String>,
}

impl Eval {
    pub(crate) async fn run(self, context: &SessionContext) -> Result<(), Failure> {
        let models = Models::load(&self.model)?;
        let [target] = models.columns().targets.as_slice() else {
            return Err(Failure::new("the model has several targets; expected one"));
        };
        let target = self.target.clone().unwrap_or_else(|| target.clone());
        let table = Table::open(context, &self.inputs.files).await?;
        check_columns(&models, &table)?;
        let found = table.column(&target)?;
        if !found.is_numeric() {
            return Err(Failure::new(format!(
                "column '{target}' is {found}; expected numbers"
            )));
        }
        let (rows, prediction) = models.apply(context, table.rows).await?;
        let truth = cast(ident(&target), DataType::Float64);
        let all = rows.clone().count().await?;
        let rows = rows
            .select(vec![
                truth.clone().alias("t"),
                (prediction - truth).alias("e"),
            ])?
            .filter(col("t").is_not_null().and(col("e").is_not_null()))?
            .aggregate(
                Vec::new(),
                vec![
                    count(col("e")),
                    avg(col("e") * col("e")),
                    avg(abs(col("e"))),
                    var_pop(col("t")),
                ],
            )?
            .collect()
            .await?;
        let used = integer(&rows, 0).unwrap_or(0);
        let numbers = [number(&rows, 1), number(&rows, 2), number(&rows, 3)];
        let (0.., [Some(square), Some(absolute), Some(variance)]) = (used - 1, numbers) else {
            return Err(Failure::new(format!(
                "none of {all} rows has a prediction and a true value"
            )));
        };
        print(&format!(
            "rows  {used} (of {all}; the others have no prediction or no true value)"
        ))?;
        print(&format!("rmse  {:.6e}", square.sqrt()))?;
        print(&format!("mae   {absolute:.6e}"))?;
        print(&format!("r2    {:.6}", 1.0 - square / variance))
    }
}

fn check_columns(models: &Models, table: &Table) -> Result<(), Failure> {
    let columns = models.columns();
    for feature in &columns.features {
        let found = table.column(&feature.name)?;
        let expected = if feature.categories.is_some() {
            "text"
        } else {
            "numbers"
        };
        let number = found.is_numeric() || matches!(found, DataType::Boolean | DataType::Null);
        if feature.categories.is_none() && !number {
            let name = &feature.name;
            return Err(Failure::new(format!(
                "column '{name}' is {found}; expected {expected}"
            )));
        }
    }
    for group in &columns.groups {
        table.column(group)?;
    }
    Ok(())
}

fn number(rows: &[RecordBatch], column: usize) -> Option<f64> {
    let values = rows
        .first()?
        .column(column)
        .as_primitive_opt::<Float64Type>()?;
    (!values.is_empty() && values.is_valid(0)).then(|| values.value(0))
}

fn integer(rows: &[RecordBatch], column: usize) -> Option<i64> {
    let values = rows
        .first()?
        .column(column)
        .as_primitive_opt::<Int64Type>()?;
    (!values.is_empty() && values.is_valid(0)).then(|| values.value(0))
}
