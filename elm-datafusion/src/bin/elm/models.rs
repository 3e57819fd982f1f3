//! Files of models: one network, or a table of networks of groups.

use std::collections::HashMap;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use datafusion::arrow::array::RecordBatch;
use datafusion::arrow::compute::{
    SortColumn, concat_batches, lexsort_to_indices, take_record_batch,
};
use datafusion::arrow::datatypes::Schema;
use datafusion::common::{Column, JoinType, ScalarValue};
use datafusion::dataframe::DataFrame;
use datafusion::logical_expr::{Expr, ScalarUDF, lit};
use datafusion::prelude::{ParquetReadOptions, SessionContext};
use elm::persist;
use elm_datafusion::{Columns, ElmPredict, TableModel};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use crate::failure::Failure;
use crate::output::Output;

/// The key of the columns in the metadata of a table of networks.
const KEY: &str = "elm.columns";
/// What the column of networks is called.
pub(crate) const MODEL: &str = "model";

/// What a file holds.
pub(crate) enum Models {
    One(Box<TableModel>),
    Groups {
        path: String,
        columns: Columns,
        count: i64,
    },
}

impl Models {
    pub(crate) fn load(path: &Path) -> Result<Self, Failure> {
        let parquet = path
            .extension()
            .is_some_and(|end| end.eq_ignore_ascii_case("parquet"));
        if !parquet {
            return Ok(Self::One(Box::new(persist::load(path)?)));
        }
        let place = path.display();
        let file = File::open(path)
            .map_err(|reason| Failure::at(format!("cannot read {place}"), reason))?;
        let builder = ParquetRecordBatchReaderBuilder::try_new(file)
            .map_err(|reason| Failure::at(place.to_string(), reason))?;
        let text = builder.schema().metadata().get(KEY).ok_or_else(|| {
            Failure::at(
                &place,
                "not a table of networks, which 'elm fit --group-by' writes",
            )
        })?;
        let columns = serde_json::from_str(text).map_err(|reason| Failure::at(&place, reason))?;
        let count = builder.metadata().file_metadata().num_rows();
        Ok(Self::Groups {
            path: path.to_string_lossy().into_owned(),
            columns,
            count,
        })
    }

    pub(crate) fn columns(&self) -> &Columns {
        match self {
            Self::One(model) => &model.columns,
            Self::Groups { columns, .. } => columns,
        }
    }

    /// The rows, and the expression that is their prediction.
    pub(crate) async fn apply(
        &self,
        context: &SessionContext,
        rows: DataFrame,
    ) -> Result<(DataFrame, Expr), Failure> {
        let columns = self.columns();
        let function = if columns.targets.len() == 1 {
            ElmPredict::one()
        } else {
            ElmPredict::all()
        };
        let function = ScalarUDF::from(function);
        let mut arguments = Vec::new();
        let rows = match self {
            Self::One(model) => {
                let bytes = persist::to_bytes(&model.model)?;
                arguments.push(lit(ScalarValue::BinaryView(Some(bytes))));
                rows
            }
            Self::Groups { path, columns, .. } => {
                let options = ParquetReadOptions::new().skip_metadata(true);
                let models = context.read_parquet(path.as_str(), options).await?;
                let renamed =
                    |name: &String| Expr::Column(Column::from_name(name)).alias(inner(name));
                let mut selected: Vec<Expr> = columns.groups.iter().map(renamed).collect();
                selected.push(Expr::Column(Column::from_name(MODEL)).alias(inner(MODEL)));
                let models = models.select(selected)?;
                let theirs = columns.groups.iter().map(|name| quoted(&inner(name)));
                let theirs: Vec<String> = theirs.collect();
                let ours: Vec<String> = columns.groups.iter().map(|name| quoted(name)).collect();
                let theirs: Vec<&str> = theirs.iter().map(String::as_str).collect();
                let ours: Vec<&str> = ours.iter().map(String::as_str).collect();
                arguments.push(Expr::Column(Column::from_name(inner(MODEL))));
                rows.join(models, JoinType::Left, &ours, &theirs, None)?
            }
        };
        arguments.extend(columns.inputs()?.into_iter().map(Expr::unalias));
        Ok((rows, function.call(arguments)))
    }
}

/// A name that no column of the user's has.
fn inner(name: &str) -> String {
    format!("elm model {name}")
}

/// A name as it is, which SQL would put in lower case.
fn quoted(name: &str) -> String {
    format!("\"{}\"", name.replace('"', "\"\""))
}

/// Writes networks of groups, in the groups' order: the groups' columns, then the networks.
pub(crate) fn save_groups(
    path: &Path,
    columns: &Columns,
    batches: &[RecordBatch],
) -> Result<(), Failure> {
    let Some(first) = batches.first() else {
        return Err(Failure::new("no groups to fit"));
    };
    let text = serde_json::to_string(columns).map_err(|reason| Failure::new(reason.to_string()))?;
    let metadata = HashMap::from([(KEY.to_owned(), text)]);
    let fields = first.schema().fields().clone();
    let schema = Arc::new(Schema::new_with_metadata(fields, metadata));
    let networks = concat_batches(&first.schema(), batches)?;
    // Partitions end in an order of their own.
    let by_group = networks.columns().iter().take(columns.groups.len());
    let by_group: Vec<SortColumn> = by_group
        .map(|values| SortColumn {
            values: Arc::clone(values),
            options: None,
        })
        .collect();
    let networks = take_record_batch(&networks, &lexsort_to_indices(&by_group, None)?)?;
    let networks = RecordBatch::try_new(Arc::clone(&schema), networks.columns().to_vec())?;
    let mut output = Output::create(path, &schema)?;
    output.write(&networks)?;
    output.finish()
}
