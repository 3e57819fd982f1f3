//! A network together with the columns that it was fitted to.

use datafusion::arrow::datatypes::DataType;
use datafusion::common::{Column, ScalarValue};
use datafusion::error::Result;
use datafusion::logical_expr::{Expr, cast, ident, lit, when};
use elm::Elm;
use elm::persist::Persist;
use serde::{Deserialize, Serialize};

/// A column that a network takes as input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Feature {
    /// The column's name.
    pub name: String,
    /// Of a column of text, its values in the rows that were fitted: an input of 0 and 1 for each. Other
    /// values are 0 in all.
    pub categories: Option<Vec<String>>,
}

impl Feature {
    /// The inputs that the column becomes; NULL stays NULL.
    ///
    /// # Errors
    /// None but those of building expressions.
    pub fn inputs(&self) -> Result<Vec<Expr>> {
        let column = || Expr::Column(Column::from_name(&self.name));
        let Some(categories) = &self.categories else {
            return Ok(vec![cast(column(), DataType::Float64).alias(&self.name)]);
        };
        let inputs = categories.iter().map(|category| {
            let null = lit(ScalarValue::Float64(None));
            let text = cast(column(), DataType::Utf8);
            let input = when(column().is_null(), null)
                .when(text.eq(lit(category.as_str())), lit(1.0))
                .otherwise(lit(0.0))?;
            Ok(input.alias(format!("{} = {category}", self.name)))
        });
        inputs.collect()
    }

    /// How many inputs it becomes.
    #[must_use]
    pub fn width(&self) -> usize {
        self.categories.as_ref().map_or(1, Vec::len)
    }
}

/// What a network was fitted to, which a table of networks of groups has in the file's metadata.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Columns {
    /// The columns of inputs.
    pub features: Vec<Feature>,
    /// The columns of targets.
    pub targets: Vec<String>,
    /// The columns whose values tell groups apart; none in a file of one network.
    pub groups: Vec<String>,
    /// Rows that were fitted.
    pub rows: u64,
    /// Rows that had a NULL.
    pub skipped: u64,
}

impl Columns {
    /// All inputs, in the network's order.
    ///
    /// # Errors
    /// Those of [`Feature::inputs`].
    pub fn inputs(&self) -> Result<Vec<Expr>> {
        let inputs: Result<Vec<Vec<Expr>>> = self.features.iter().map(Feature::inputs).collect();
        Ok(inputs?.into_iter().flatten().collect())
    }

    /// The targets as numbers.
    #[must_use]
    pub fn target_values(&self) -> Vec<Expr> {
        let value = |name: &String| cast(ident(name), DataType::Float64).alias(name);
        self.targets.iter().map(value).collect()
    }
}

/// What `elm fit -o model.elm` writes: a network and the columns that it was fitted to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TableModel {
    /// The columns.
    pub columns: Columns,
    /// The network.
    pub model: Elm<f64>,
}

impl Persist for TableModel {
    const KIND: &'static str = "elm table model";
    const SCALAR: &'static str = "f64";
    /// 100 times this layout's and the network's, which is part of it.
    const VERSION: u32 = 100 + <Elm<f64> as Persist>::VERSION;
}
