//! Queries whose `elm_fit` need a first pass over their rows.

use std::collections::HashMap;
use std::sync::Arc;

use datafusion::arrow::array::{Array, AsArray};
use datafusion::common::tree_node::{Transformed, TreeNode, TreeNodeRecursion};
use datafusion::dataframe::DataFrame;
use datafusion::error::Result;
use datafusion::logical_expr::expr::AggregateFunction;
use datafusion::logical_expr::{Aggregate, AggregateUDF, Expr, LogicalPlan, LogicalPlanBuilder};
use datafusion::prelude::SessionContext;
use datafusion::sql::parser::{DFParser, Statement};
use elm::persist;

use crate::error::failed;
use crate::fit::{ElmFit, NAME};
use crate::options::{ElmOptions, FirstPass};
use crate::sample::{ElmSample, Sample};
use crate::settings::Settings;

/// The statements of a text, which semicolons separate.
///
/// # Errors
/// That of the parser, with line and column.
pub fn statements(text: &str) -> Result<Vec<Statement>> {
    Ok(DFParser::parse_sql(text)?.into())
}

/// Runs one statement as [`SessionContext::sql`] does, and before it the first pass that each `elm_fit`
/// without GROUP BY needs (see the option `elm.first_pass`): rows are then read twice.
///
/// # Errors
/// Those of planning and of the first pass.
pub async fn sql(context: &SessionContext, statement: Statement) -> Result<DataFrame> {
    let plan = context.state().statement_to_plan(statement).await?;
    let plan = first_pass(context, plan).await?;
    context.execute_logical_plan(plan).await
}

/// A fit in a plan: its rows, and the call.
type Place = (Arc<LogicalPlan>, AggregateFunction);

/// The plan with settings and the findings of first passes in every `elm_fit`.
///
/// # Errors
/// Those of planning and of the first pass.
pub async fn first_pass(context: &SessionContext, plan: LogicalPlan) -> Result<LogicalPlan> {
    let options = ElmOptions::of(context.state().config_options());
    let when = options.first_pass();
    let mut places: Vec<Place> = Vec::new();
    plan.apply_with_subqueries(|node| {
        if let LogicalPlan::Aggregate(aggregate) = node {
            let wanted = match when.as_ref() {
                Err(_) => true,
                Ok(FirstPass::Never) => false,
                Ok(FirstPass::Always) => true,
                Ok(FirstPass::WithoutGroups) => aggregate.group_expr.is_empty(),
            };
            for call in aggregate
                .aggr_expr
                .iter()
                .filter_map(unbound)
                .filter(|_| wanted)
            {
                places.push((Arc::clone(&aggregate.input), call.clone()));
            }
        }
        Ok(TreeNodeRecursion::Continue)
    })?;
    if places.is_empty() {
        return Ok(plan);
    }
    // Not before there is a fit: a statement that corrects an option must run.
    when?;
    let settings = options.settings()?;
    let mut bound = HashMap::new();
    for place in places {
        let sample = sample_of(context, &place, &settings).await?;
        bound.insert(place, ElmFit::new(settings.clone(), Some(sample)));
    }
    let plan = plan.transform_down_with_subqueries(|node| {
        let LogicalPlan::Aggregate(aggregate) = node else {
            return Ok(Transformed::no(node));
        };
        let input = Arc::clone(&aggregate.input);
        let calls = aggregate
            .aggr_expr
            .into_iter()
            .map(|expr| with_sample(expr, &input, &bound));
        let calls: Result<Vec<Expr>> = calls.collect();
        let aggregate = Aggregate::try_new(input, aggregate.group_expr, calls?)?;
        Ok(Transformed::yes(LogicalPlan::Aggregate(aggregate)))
    })?;
    Ok(plan.data)
}

/// The call of `elm_fit` in an expression, if it has no settings yet.
fn unbound(expr: &Expr) -> Option<&AggregateFunction> {
    let call = match expr {
        Expr::AggregateFunction(call) => call,
        Expr::Alias(alias) => return unbound(&alias.expr),
        _ => return None,
    };
    let inner: &dyn std::any::Any = call.func.inner().as_ref();
    let fit = inner.downcast_ref::<ElmFit>()?;
    (!fit.is_bound()).then_some(call)
}

fn with_sample(
    expr: Expr,
    input: &Arc<LogicalPlan>,
    bound: &HashMap<Place, ElmFit>,
) -> Result<Expr> {
    let found = unbound(&expr).and_then(|call| bound.get(&(Arc::clone(input), call.clone())));
    let Some(fit) = found else {
        return Ok(expr);
    };
    let replaced = expr.transform_down(|expr| {
        Ok(match expr {
            Expr::AggregateFunction(mut call) if call.func.name() == NAME => {
                call.func = Arc::new(AggregateUDF::from(fit.clone()));
                Transformed::yes(Expr::AggregateFunction(call))
            }
            other => Transformed::no(other),
        })
    })?;
    Ok(replaced.data)
}

async fn sample_of(
    context: &SessionContext,
    (input, call): &Place,
    settings: &Settings,
) -> Result<Sample> {
    let mut call = call.clone();
    let function = ElmSample::new(settings.leading(), settings.weighted, settings.nulls);
    call.func = Arc::new(AggregateUDF::from(function));
    let plan = LogicalPlanBuilder::from(Arc::clone(input))
        .aggregate(Vec::<Expr>::new(), vec![Expr::AggregateFunction(call)])?
        .build()?;
    // The rows may come from a fit themselves.
    let plan = Box::pin(first_pass(context, plan)).await?;
    let batches = DataFrame::new(context.state(), plan).collect().await?;
    let cell = batches
        .first()
        .and_then(|batch| batch.column(0).as_binary_view_opt());
    let bytes = cell
        .filter(|cell| !cell.is_empty())
        .map(|cell| cell.value(0));
    let bytes = bytes.ok_or_else(|| failed(NAME, "the first pass found nothing"))?;
    persist::from_bytes(bytes).map_err(|error| failed(NAME, error))
}
