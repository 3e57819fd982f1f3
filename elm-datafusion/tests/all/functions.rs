//! The SQL functions against the library on the same rows.

use std::sync::Arc;

use datafusion::arrow::array::{Array, ArrayRef, AsArray, Float64Array, Int64Array, RecordBatch};
use datafusion::arrow::datatypes::Float64Type;
use datafusion::datasource::MemTable;
use datafusion::error::Result;
use datafusion::prelude::{SessionConfig, SessionContext};
use elm::solve::Ridge;
use elm::{Accumulator, Elm, ElmParams, Scaler, persist};
use ndarray::{Array1, Array2, s};

const ROWS: usize = 3000;

fn inputs() -> (Array2<f64>, Array1<f64>) {
    let x = Array2::from_shape_fn((ROWS, 2), |(i, j)| ((i * (3 + 4 * j)) as f64 * 0.37).sin());
    let y = x.map_axis(ndarray::Axis(1), |row| row[0] * row[1] + row[0]);
    (x, y)
}

/// A session with the rows as `rows` in this many partitions, and `sensor`, the row's number modulo 5.
async fn session(partitions: usize, options: &[&str]) -> Result<SessionContext> {
    let config = SessionConfig::new()
        .with_target_partitions(partitions)
        .with_batch_size(128);
    let context = SessionContext::new_with_config(config);
    elm_datafusion::register(&context)?;
    let (x, y) = inputs();
    let mut parts = vec![Vec::new(); partitions];
    for (number, start) in (0..ROWS).step_by(100).enumerate() {
        let range = start..start + 100;
        let column = |j: usize| {
            Arc::new(Float64Array::from(x.slice(s![range.clone(), j]).to_vec())) as ArrayRef
        };
        let sensors: Vec<i64> = range.clone().map(|row| (row % 5) as i64).collect();
        let batch = RecordBatch::try_from_iter([
            ("sensor", Arc::new(Int64Array::from(sensors)) as ArrayRef),
            ("x1", column(0)),
            ("x2", column(1)),
            (
                "y",
                Arc::new(Float64Array::from(y.slice(s![range.clone()]).to_vec())),
            ),
        ])?;
        parts[number % partitions].push(batch);
    }
    let schema = parts[0][0].schema();
    context.register_table("rows", Arc::new(MemTable::try_new(schema, parts)?))?;
    for option in options {
        context.sql(option).await?;
    }
    Ok(context)
}

async fn query(context: &SessionContext, text: &str) -> Result<RecordBatch> {
    let mut last = None;
    for statement in elm_datafusion::statements(text)? {
        let rows = elm_datafusion::sql(context, statement).await?;
        let schema = Arc::clone(rows.schema().inner());
        let batches = rows.collect().await?;
        last = Some(datafusion::arrow::compute::concat_batches(
            &schema, &batches,
        )?);
    }
    Ok(last.unwrap())
}

fn bytes(batch: &RecordBatch, column: usize, row: usize) -> Vec<u8> {
    batch.column(column).as_binary_view().value(row).to_vec()
}

fn difference(model: &Elm<f64>, other: &Elm<f64>) -> f64 {
    let (x, _) = inputs();
    let pairs = model.predict(&x).unwrap() - other.predict(&x).unwrap();
    pairs.iter().fold(0.0, |most, value| value.abs().max(most))
}

#[tokio::test]
async fn many_rows_give_the_accumulators_model_whatever_the_partitions() {
    let (x, y) = inputs();
    let params = ElmParams::new(40).with_solver(Ridge::gcv());
    let mut sums = Accumulator::with_scaler(&params, Scaler::measured(&x).unwrap(), 1).unwrap();
    sums.push(&x, &y.insert_axis(ndarray::Axis(1))).unwrap();
    let expected: Elm<f64> = sums.fit().unwrap();
    for partitions in [1, 2, 7] {
        let options = ["SET elm.neurons = 40", "SET elm.group_rows = 100"];
        let context = session(partitions, &options).await.unwrap();
        let found = query(&context, "SELECT elm_fit(y, x1, x2) FROM rows")
            .await
            .unwrap();
        let model: Elm<f64> = persist::from_bytes(&bytes(&found, 0, 0)).unwrap();
        let most = difference(&model, &expected);
        assert!(most < 1e-7, "{partitions}: {most}");
    }
}

#[tokio::test]
async fn a_group_of_few_rows_is_fitted_as_by_the_library_bit_for_bit_whatever_the_partitions() {
    let mut models = Vec::new();
    for partitions in [1, 4] {
        let context = session(partitions, &["SET elm.neurons = 30"])
            .await
            .unwrap();
        let text =
            "SELECT sensor, elm_fit(y, x1, x2) AS m FROM rows GROUP BY sensor ORDER BY sensor";
        let found = query(&context, text).await.unwrap();
        assert_eq!(found.num_rows(), 5);
        models.push(
            (0..5)
                .map(|group| bytes(&found, 1, group))
                .collect::<Vec<_>>(),
        );
    }
    assert_eq!(models[0], models[1]);
    let (x, y) = inputs();
    let rows: Vec<usize> = (0..ROWS).filter(|row| row % 5 == 2).collect();
    let (x, y) = (
        x.select(ndarray::Axis(0), &rows),
        y.select(ndarray::Axis(0), &rows),
    );
    let expected = ElmParams::new(30)
        .fit(&x, &y.insert_axis(ndarray::Axis(1)))
        .unwrap();
    let model: Elm<f64> = persist::from_bytes(&models[0][2]).unwrap();
    let most = difference(&model, &expected);
    assert!(most < 1e-7, "{most}");
}

#[tokio::test]
async fn predictions_of_one_model_and_of_one_per_row() {
    let context = session(3, &["SET elm.neurons = 40"]).await.unwrap();
    let text = "WITH models AS (SELECT sensor AS s, elm_fit(y, x1, x2) AS m FROM rows GROUP BY sensor)
                SELECT max(abs(elm_predict(m, x1, x2) - y)), count(*) FROM rows JOIN models ON sensor = s";
    let found = query(&context, text).await.unwrap();
    assert!(found.column(0).as_primitive::<Float64Type>().value(0) < 1e-3);
    let text = "WITH models AS (SELECT elm_fit(y, x1, x2) AS m FROM rows)
                SELECT elm_predict(m, x1, x2) AS p, y, x1, x2, m FROM rows CROSS JOIN models";
    let found = query(&context, text).await.unwrap();
    let model: Elm<f64> = persist::from_bytes(&bytes(&found, 4, 0)).unwrap();
    let column = |j: usize| {
        found
            .column(j)
            .as_primitive::<Float64Type>()
            .values()
            .to_vec()
    };
    let x = ndarray::stack![
        ndarray::Axis(1),
        Array1::from(column(2)),
        Array1::from(column(3))
    ];
    let expected = model.predict(&x).unwrap();
    for (found, expected) in column(0).iter().zip(expected.column(0)) {
        assert!((found - expected).abs() < 1e-9);
    }
}

#[tokio::test]
async fn several_targets_weights_and_nulls() {
    let options = [
        "SET elm.neurons = 40",
        "SET elm.targets = 2",
        "SET elm.weighted = true",
    ];
    let context = session(2, &options).await.unwrap();
    let text = "WITH model AS (SELECT elm_fit(y, 2 * y, 1 + sensor, x1, x2) AS m FROM rows)
                SELECT elm_predict_all(m, x1, x2), y FROM rows CROSS JOIN model LIMIT 10";
    let found = query(&context, text).await.unwrap();
    let first = found.column(0).as_list::<i32>().value(3);
    let (first, y) = (
        first.as_primitive::<Float64Type>(),
        found.column(1).as_primitive::<Float64Type>(),
    );
    assert!((first.value(0) - y.value(3)).abs() < 1e-3);
    assert!((first.value(1) - 2.0 * y.value(3)).abs() < 2e-3);

    let context = session(2, &["SET elm.neurons = 40"]).await.unwrap();
    let text = "SELECT elm_fit(y, x1, CASE WHEN sensor = 1 THEN NULL ELSE x2 END) FROM rows";
    let skipped = query(&context, text).await.unwrap();
    let filtered = "SELECT elm_fit(y, x1, x2) FROM rows WHERE sensor <> 1";
    let filtered = query(&context, filtered).await.unwrap();
    assert_eq!(bytes(&skipped, 0, 0), bytes(&filtered, 0, 0));
    context.sql("SET elm.nulls = 'error'").await.unwrap();
    let error = query(&context, text).await.unwrap_err().to_string();
    assert!(error.contains("is NULL"), "{error}");
    let text = "WITH model AS (SELECT elm_fit(y, x1, x2) AS m FROM rows)
                SELECT elm_predict(m, x1, NULL) FROM rows CROSS JOIN model LIMIT 1";
    assert!(query(&context, text).await.unwrap().column(0).is_null(0));
}

/// Filters, NULLs and rows that are passed on as states one by one: the models of the rows that are left.
#[tokio::test]
async fn groups_have_the_models_of_their_rows_alone() {
    let by_sensor = |what: &str, rows: &str| {
        format!("SELECT sensor, {what} AS m FROM rows {rows} GROUP BY sensor ORDER BY sensor")
    };
    let models = async |context: &SessionContext, text: &str| -> Vec<Vec<u8>> {
        let found = query(context, text).await.unwrap();
        (0..found.num_rows())
            .map(|row| bytes(&found, 1, row))
            .collect()
    };
    let one_by_one = [
        "SET datafusion.execution.skip_partial_aggregation_probe_ratio_threshold = 0",
        "SET datafusion.execution.skip_partial_aggregation_probe_rows_threshold = 1",
    ];
    let mut found = Vec::new();
    for options in [&[][..], &one_by_one] {
        let context = session(3, options).await.unwrap();
        context.sql("SET elm.neurons = 20").await.unwrap();
        let rows = by_sensor("elm_fit(y, x1, x2)", "WHERE x1 > 0 OR sensor = 3");
        let expected = models(&context, &rows).await;
        assert_eq!(expected.len(), 5);
        let filtered = "elm_fit(y, x1, x2) FILTER (WHERE x1 > 0 OR sensor = 3)";
        let nulls = "elm_fit(y, x1, CASE WHEN x1 > 0 OR sensor = 3 THEN x2 END)";
        for what in [filtered, nulls] {
            assert_eq!(
                models(&context, &by_sensor(what, "")).await,
                expected,
                "{what}"
            );
        }
        context.sql("SET elm.nulls = 'error'").await.unwrap();
        let error = query(&context, &by_sensor(nulls, "")).await.unwrap_err();
        assert!(error.to_string().contains("is NULL"), "{error}");
        // A NULL that the filter keeps out is none.
        let both = nulls.to_owned() + " FILTER (WHERE x1 > 0 OR sensor = 3)";
        assert_eq!(models(&context, &by_sensor(&both, "")).await, expected);
        let none = by_sensor("elm_fit(y, x1, x2) FILTER (WHERE sensor <> 2)", "");
        let error = query(&context, &none).await.unwrap_err().to_string();
        assert!(error.contains("no rows to fit"), "{error}");
        found.push(expected);
    }
    assert_eq!(found[0], found[1]);
}

#[tokio::test]
async fn errors_say_what_is_wrong_and_where() {
    let context = session(2, &[]).await.unwrap();
    let many = vec!["x1"; 10_001].join(", ");
    let cases = [
        (
            "SELECT elm_fit(y, x1) FROM rows WHERE sensor > 9",
            "no rows",
        ),
        (
            "SELECT elm_fit(3, x1) FROM rows",
            "is constant: 3 in all 3000 rows",
        ),
        (
            "SELECT elm_fit(y, 'text') FROM rows",
            "argument 2 is Utf8; expected a number",
        ),
        (
            "SELECT elm_fit(y) FROM rows",
            "expected a target and at least one input",
        ),
        ("SELECT elm_fit(DISTINCT y, x1) FROM rows", "DISTINCT"),
        (
            "SELECT elm_predict(x1, x2) FROM rows",
            "argument 1 is Float64; expected a model",
        ),
        (
            "SELECT elm_predict(CAST('abc' AS BYTEA), x2) FROM rows",
            "not an elm file",
        ),
        (
            "SELECT elm_predict(m, x1) FROM rows CROSS JOIN (SELECT elm_fit(y, x1, x2) AS m FROM rows)",
            "1 inputs; the model expects 2",
        ),
        (
            &format!("SELECT elm_fit(y, {many}) FROM rows"),
            "expected at most 10000",
        ),
        (
            "SET elm.neurons = 0; SELECT elm_fit(y, x1) FROM rows",
            "neurons",
        ),
        (
            "SET elm.neurons = 5; SET elm.activation = 'no'; SELECT elm_fit(y, x1) FROM rows",
            "elm.activation is 'no'",
        ),
        (
            "SET elm.activation = 'tanh'; SET elm.lambda = 'x'; SELECT elm_fit(y, x1) FROM rows",
            "elm.lambda is 'x'",
        ),
        ("SET elm.neuron = 0", "neuron"),
        (
            "SET elm.lambda = 'auto'; SET elm.group_rows = 10; SELECT elm_fit(y, x1) FROM rows GROUP BY sensor",
            "elm.first_pass",
        ),
    ];
    for (text, expected) in cases {
        let error = query(&context, text).await.unwrap_err().to_string();
        assert!(error.contains(expected), "{expected}: {error}");
    }
}

#[tokio::test]
async fn a_first_pass_for_all_groups_and_groups_without_a_model() {
    let options = [
        "SET elm.group_rows = 100",
        "SET elm.first_pass = 'always'",
        "SET elm.failed = 'null'",
    ];
    let context = session(3, &options).await.unwrap();
    let text = "SELECT sensor, elm_fit(CASE WHEN sensor = 2 THEN 0 ELSE y END, x1, x2)
                FROM rows GROUP BY sensor ORDER BY sensor";
    let found = query(&context, text).await.unwrap();
    let models = found.column(1);
    assert_eq!(
        (0..5)
            .filter(|&row| models.is_null(row))
            .collect::<Vec<_>>(),
        [2]
    );
}
