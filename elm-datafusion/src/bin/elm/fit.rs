//! `elm fit`.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use clap::{Args, ValueEnum};
use datafusion::arrow::array::{Array, AsArray, RecordBatch};
use datafusion::arrow::datatypes::{DataType, Int64Type};
use datafusion::common::Column;
use datafusion::dataframe::DataFrame;
use datafusion::functions_aggregate::expr_fn::count;
use datafusion::logical_expr::{AggregateUDF, Expr, cast, ident, lit, when};
use datafusion::prelude::SessionContext;
use elm::solve::Ridge;
use elm::{Activation, Dataset, ElmParams, persist};
use elm_datafusion::{Columns, ElmFit, ElmSample, Feature, Nulls, Sample, Settings, TableModel};
use indicatif::{ProgressBar, ProgressStyle};
use ndarray::s;

use crate::Inputs;
use crate::cluster::{self, Cluster};
use crate::failure::Failure;
use crate::files::{Kind, Table, is_text};
use crate::models::{self, MODEL};

/// The column that counts the rows of networks: a name that no column of the user's has.
const ROWS: &str = "elm rows";

/// Arguments of `elm fit`.
#[derive(Debug, Args)]
pub(crate) struct Fit {
    #[command(flatten)]
    inputs: Inputs,
    /// Columns to predict
    #[arg(long, required = true, value_delimiter = ',')]
    target: Vec<String>,
    /// Columns to predict from; all others unless given
    #[arg(long, value_delimiter = ',')]
    features: Vec<String>,
    /// Fit a network for each value of these columns; the output is a Parquet table
    #[arg(long, value_delimiter = ',')]
    group_by: Vec<String>,
    /// A column of weights of rows
    #[arg(long)]
    weight: Option<String>,
    /// Hidden neurons, or 'auto' to search settings on a sample of rows
    #[arg(long, default_value = "100")]
    neurons: String,
    /// The neurons' function
    #[arg(long, default_value = "sigmoid")]
    activation: Activation<f64>,
    /// Strength of the ridge penalty relative to the largest squared singular value; chosen unless given
    #[arg(long)]
    lambda: Option<f64>,
    /// Spread of the random weights
    #[arg(long, default_value_t = 1.0)]
    scale: f64,
    /// Seed of the random layer
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Rows with a NULL in a column that is used
    #[arg(long, value_enum, default_value_t = OnNull::Skip)]
    nulls: OnNull,
    /// Most values that a column of text may have; each becomes an input of 0 and 1
    #[arg(long, default_value_t = 64)]
    categories: usize,
    /// Groups of at most this many rows are scaled by themselves
    #[arg(long, default_value_t = 10_000)]
    group_rows: usize,
    /// The model's file
    #[arg(short, long)]
    output: PathBuf,
    #[command(flatten)]
    cluster: Cluster,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum OnNull {
    Skip,
    Error,
}

/// What a first pass found.
#[derive(Default)]
struct FirstPass {
    /// Rows without NULL.
    rows: u64,
    skipped: u64,
    sample: Option<Sample>,
}

impl Fit {
    pub(crate) async fn run(self, embedded: &SessionContext) -> Result<(), Failure> {
        self.check_output()?;
        let context = self.cluster.session(embedded).await?;
        self.cluster.within(self.run_in(&context)).await
    }

    async fn run_in(&self, context: &SessionContext) -> Result<(), Failure> {
        let table = Table::open(context, &self.inputs.files).await?;
        let mut columns = self.columns(&table).await?;
        let arguments = self.arguments(&table, &columns)?;
        let nulls = match self.nulls {
            OnNull::Skip => Nulls::Skip,
            OnNull::Error => Nulls::Error,
        };
        let first = self.first_pass(&table.rows, &arguments, nulls).await?;
        if first.rows == 0 {
            return Err(Failure::new(format!(
                "no rows to fit ({} with NULL were skipped)",
                first.skipped
            )));
        }
        (columns.rows, columns.skipped) = (first.rows, first.skipped);
        let mut settings = Settings::new(self.params(first.sample.as_ref())?);
        settings.targets = self.target.len();
        settings.weighted = self.weight.is_some();
        settings.nulls = nulls;
        settings.group_rows = self.group_rows;
        let batches = self.fit(table.rows, arguments, settings, first).await?;
        let what = if self.group_by.is_empty() {
            let model = persist::from_bytes(cell(&batches, 0)?)?;
            persist::save(
                &TableModel {
                    columns: columns.clone(),
                    model,
                },
                &self.output,
            )?;
            "1 network".to_owned()
        } else {
            models::save_groups(&self.output, &columns, &batches)?;
            format!(
                "{} networks",
                batches.iter().map(RecordBatch::num_rows).sum::<usize>()
            )
        };
        let (rows, skipped, output) = (columns.rows, columns.skipped, self.output.display());
        eprintln!("{what} from {rows} rows ({skipped} with NULL skipped): {output}");
        Ok(())
    }

    /// Before any work: a table of networks is Parquet, one network is not a table.
    fn check_output(&self) -> Result<(), Failure> {
        let name = self.output.to_string_lossy();
        let table = Kind::of(&name).is_ok_and(|kind| kind == Kind::Parquet);
        if table == self.group_by.is_empty() {
            let expected = if table {
                "a name such as model.elm"
            } else {
                "a name that ends in .parquet"
            };
            return Err(Failure::at(
                format!("-o {name}"),
                format!("expected {expected}"),
            ));
        }
        let folder = self
            .output
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty());
        if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
            let reason = format!("no folder {}", folder.display());
            return Err(Failure::at(format!("cannot write {name}"), reason));
        }
        Ok(())
    }

    async fn columns(&self, table: &Table) -> Result<Columns, Failure> {
        let taken: Vec<&String> = self
            .target
            .iter()
            .chain(&self.group_by)
            .chain(&self.weight)
            .collect();
        for name in self.target.iter().chain(&self.weight) {
            let found = table.column(name)?;
            if !is_number(found) {
                return Err(Failure::new(format!(
                    "column '{name}' is {found}; expected numbers"
                )));
            }
        }
        for name in &self.group_by {
            table.column(name)?;
            if name == MODEL {
                return Err(Failure::new(format!(
                    "column '{name}' cannot be a group, as networks are in a column of this name: rename it, by \
                     elm sql \"SELECT {name} AS kind, ...\" -o FILE"
                )));
            }
        }
        let names = if self.features.is_empty() {
            table
                .names()
                .into_iter()
                .filter(|name| !taken.contains(&name))
                .collect()
        } else {
            self.features.clone()
        };
        if names.is_empty() {
            return Err(Failure::new("no columns to predict from"));
        }
        let mut features = Vec::with_capacity(names.len());
        for name in names {
            if taken.contains(&&name) {
                return Err(Failure::new(format!(
                    "column '{name}' cannot be a feature as well"
                )));
            }
            let found = table.column(&name)?;
            let categories = if is_text(found) {
                Some(self.categories_of(table, &name).await?)
            } else if is_number(found) {
                None
            } else {
                let reason = "expected numbers or text: name others by --features";
                return Err(Failure::new(format!(
                    "column '{name}' is {found}; {reason}"
                )));
            };
            features.push(Feature { name, categories });
        }
        let (targets, groups) = (self.target.clone(), self.group_by.clone());
        Ok(Columns {
            features,
            targets,
            groups,
            rows: 0,
            skipped: 0,
        })
    }

    /// The values of a column of text, sorted.
    async fn categories_of(&self, table: &Table, name: &str) -> Result<Vec<String>, Failure> {
        let column = Expr::Column(Column::from_name(name));
        let values = (table.rows.clone())
            .filter(column.clone().is_not_null())?
            .select(vec![cast(column, DataType::Utf8).alias("value")])?
            .distinct()?
            .limit(0, Some(self.categories.saturating_add(1)))?;
        let mut found = Vec::new();
        for batch in values.collect().await? {
            let values = batch.column(0).as_string_opt::<i32>();
            let values = values.ok_or_else(|| Failure::at(name, "expected text"))?;
            found.extend(values.iter().flatten().map(str::to_owned));
        }
        found.sort();
        let is_number = |value: &&String| value.trim().parse::<f64>().is_ok();
        if let (Some(_), Some(text)) = (
            found.iter().find(is_number),
            found.iter().find(|value| !is_number(value)),
        ) {
            return Err(Failure::new(format!(
                "column '{name}' holds numbers and text such as '{text}'; expected numbers, or text alone"
            )));
        }
        if found.len() > self.categories {
            let (most, example) = (self.categories, &found[0]);
            return Err(Failure::new(format!(
                "column '{name}' is text of more than {most} values, such as '{example}'; expected \
                 numbers, or at most --categories {most} values"
            )));
        }
        Ok(found)
    }

    /// What the aggregates are called with.
    fn arguments(&self, table: &Table, columns: &Columns) -> Result<Vec<Expr>, Failure> {
        const MAX_INPUTS: usize = 9_000;
        let inputs: usize = columns.features.iter().map(Feature::width).sum();
        if inputs > MAX_INPUTS {
            let reason =
                format!("{inputs} inputs; expected at most {MAX_INPUTS}: name some by --features");
            return Err(Failure::new(reason));
        }
        let mut arguments = columns.target_values();
        if let Some(weight) = &self.weight {
            table.column(weight)?;
            arguments.push(cast(ident(weight), DataType::Float64));
        }
        arguments.extend(columns.inputs()?);
        Ok(arguments.into_iter().map(Expr::unalias).collect())
    }

    /// What must be known of all rows before they are fitted: of groups kept as rows their sizes alone.
    async fn first_pass(
        &self,
        rows: &DataFrame,
        arguments: &[Expr],
        nulls: Nulls,
    ) -> Result<FirstPass, Failure> {
        if !self.group_by.is_empty()
            && self.neurons != "auto"
            && let Some(sizes) = self.small_groups(rows, arguments).await?
        {
            return Ok(sizes);
        }
        let leading = self.target.len() + usize::from(self.weight.is_some());
        let sample = ElmSample::new(leading, self.weight.is_some(), nulls);
        let sample = AggregateUDF::from(sample).call(arguments.to_vec());
        let sample = rows.clone().aggregate(Vec::new(), vec![sample])?;
        let sample: Sample = persist::from_bytes(cell(&sample.collect().await?, 0)?)?;
        Ok(FirstPass {
            rows: sample.rows(),
            skipped: sample.skipped(),
            sample: Some(sample),
        })
    }

    /// The sizes of all groups, where each is to be kept as rows.
    async fn small_groups(
        &self,
        rows: &DataFrame,
        arguments: &[Expr],
    ) -> Result<Option<FirstPass>, Failure> {
        let nulls = arguments.iter().map(|argument| argument.clone().is_null());
        let skipped = count(when(any(nulls.collect()), lit(1)).end()?);
        let groups: Vec<Expr> = self.group_by.iter().map(ident).collect();
        let counts = vec![count(lit(1)).alias(ROWS), skipped.alias("elm skipped")];
        let batches = rows.clone().aggregate(groups, counts)?.collect().await?;
        let (mut all, mut found) = (0, FirstPass::default());
        for batch in batches {
            let column = |back: usize| {
                let column = batch.columns().iter().rev().nth(back);
                let column = column.and_then(|column| column.as_primitive_opt::<Int64Type>());
                column.ok_or_else(|| Failure::new("expected a count of rows"))
            };
            let (rows, skipped) = (column(1)?.values(), column(0)?.values());
            all += rows.iter().sum::<i64>().unsigned_abs();
            found.skipped += skipped.iter().sum::<i64>().unsigned_abs();
            if rows
                .iter()
                .any(|&rows| rows.unsigned_abs() > self.group_rows as u64)
            {
                return Ok(None);
            }
        }
        found.rows = all - found.skipped;
        Ok(Some(found))
    }

    fn params(&self, sample: Option<&Sample>) -> Result<ElmParams<f64>, Failure> {
        if let Some(sample) = sample.filter(|_| self.neurons == "auto") {
            let rows = sample.matrix();
            let leading = self.target.len() + usize::from(self.weight.is_some());
            let (t, x) = (
                rows.slice(s![.., ..self.target.len()]),
                rows.slice(s![.., leading..]),
            );
            let mut data = Dataset::new(&x, &t)?;
            let weights = rows.column(leading - 1);
            if self.weight.is_some() {
                data = data.with_weights(&weights)?;
            }
            let tuned = ElmParams::auto().with_seed(self.seed).tune(&data)?;
            return Ok(tuned.params);
        }
        let neurons = self.neurons.parse().map_err(|_| {
            Failure::new(format!(
                "--neurons is '{}'; expected a number or 'auto'",
                self.neurons
            ))
        })?;
        let solver = self
            .lambda
            .map_or_else(Ridge::leave_one_out, Ridge::relative);
        let params = ElmParams::new(neurons)
            .with_activation(self.activation.clone())
            .with_scale(self.scale)
            .with_seed(self.seed)
            .with_solver(solver);
        params.check()?;
        Ok(params)
    }

    async fn fit(
        &self,
        rows: DataFrame,
        arguments: Vec<Expr>,
        settings: Settings,
        first: FirstPass,
    ) -> Result<Vec<RecordBatch>, Failure> {
        let expected = first.rows + first.skipped;
        // Executors do not say how far they are.
        let bar = match self.cluster.is_used() {
            true => ProgressBar::hidden(),
            false => progress(expected),
        };
        let fit = ElmFit::new(settings, first.sample);
        let watched = watch(bar.clone(), fit.progress());
        let groups: Vec<Expr> = self.group_by.iter().map(ident).collect();
        let call = AggregateUDF::from(fit).call(arguments).alias(MODEL);
        let count = count(lit(1)).alias(ROWS);
        let fitted = rows.aggregate(groups, vec![call, count])?.collect().await;
        watched.abort();
        bar.finish_and_clear();
        cluster::checked(fitted?, self.group_by.len(), expected)
    }
}

/// Whether any is true, as a tree that is not deep.
fn any(mut all: Vec<Expr>) -> Expr {
    while all.len() > 1 {
        let pairs = all.chunks(2);
        all = pairs
            .filter_map(|pair| pair.iter().cloned().reduce(Expr::or))
            .collect();
    }
    all.pop().unwrap_or_else(|| lit(false))
}

/// A column of NULLs alone is one of numbers, none of which is there.
fn is_number(data_type: &DataType) -> bool {
    data_type.is_numeric() || matches!(data_type, DataType::Boolean | DataType::Null)
}

/// The binary value of the first column in a row.
fn cell(batches: &[RecordBatch], row: usize) -> Result<&[u8], Failure> {
    let column = batches
        .first()
        .and_then(|batch| batch.column(0).as_binary_view_opt());
    let column = column.filter(|column| row < column.len() && column.is_valid(row));
    column
        .map(|column| column.value(row))
        .ok_or_else(|| Failure::new("no rows to fit"))
}

/// Hidden where there is no terminal.
fn progress(rows: u64) -> ProgressBar {
    let bar = ProgressBar::new(rows);
    let style = ProgressStyle::with_template("{bar:40} {human_pos}/{human_len} rows, {eta} left");
    bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

fn watch(bar: ProgressBar, rows: Arc<AtomicU64>) -> tokio::task::JoinHandle<()> {
    tokio::spawn(async move {
        loop {
            tokio::time::sleep(Duration::from_millis(200)).await;
            bar.set_position(rows.load(Ordering::Relaxed));
        }
    })
}
