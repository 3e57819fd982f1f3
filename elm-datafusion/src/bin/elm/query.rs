//! `elm sql`.

use std::io::{self, ErrorKind, Write};
use std::path::PathBuf;

use clap::Args;
use datafusion::arrow::util::pretty::pretty_format_batches;
use datafusion::logical_expr::LogicalPlan;
use datafusion::prelude::SessionContext;

use crate::cluster::Cluster;
use crate::failure::Failure;
use crate::output;

/// Rows that are printed; -o writes all.
const PRINTED: usize = 1000;

/// Arguments of `elm sql`.
#[derive(Debug, Args)]
pub(crate) struct Sql {
    /// Statements, separated by semicolons; files are tables: FROM 'rows/*.parquet'
    sql: String,
    /// Where the rows of the last statement go, instead of being printed
    #[arg(short, long)]
    output: Option<PathBuf>,
    #[command(flatten)]
    cluster: Cluster,
}

impl Sql {
    pub(crate) async fn run(self, embedded: &SessionContext) -> Result<(), Failure> {
        let context = self.cluster.session(embedded).await?;
        self.cluster.within(self.run_in(&context)).await
    }

    async fn run_in(&self, context: &SessionContext) -> Result<(), Failure> {
        let statements = elm_datafusion::statements(&self.sql)?;
        let count = statements.len();
        for (number, statement) in statements.into_iter().enumerate() {
            let rows = elm_datafusion::sql(context, statement).await?;
            match &self.output {
                Some(path) if number + 1 == count => {
                    output::save(rows, path).await?;
                }
                _ => {
                    let all = rows.schema().fields().is_empty();
                    let is_plan = matches!(
                        rows.logical_plan(),
                        LogicalPlan::Explain(_) | LogicalPlan::Analyze(_)
                    );
                    let rows = match is_plan {
                        true => rows,
                        false => rows.limit(0, Some(PRINTED + 1))?,
                    };
                    let batches = rows.collect().await?;
                    let found: usize = batches.iter().map(|batch| batch.num_rows()).sum();
                    if !all && !batches.is_empty() {
                        print(&pretty_format_batches(&batches)?.to_string())?;
                    }
                    if found > PRINTED {
                        print(&format!(
                            "more than {PRINTED} rows: write them with -o FILE"
                        ))?;
                    }
                }
            }
        }
        Ok(())
    }
}

/// A line to standard output; a reader that has had enough is no error.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    match writeln!(io::stdout(), "{text}") {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        result => result.map_err(|reason| Failure::at("cannot write to standard output", reason)),
    }
}
