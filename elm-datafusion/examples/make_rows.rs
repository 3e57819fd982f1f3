//! Writes rows of made-up measurements as Parquet files, for benchmarks:
//! `make_rows FOLDER ROWS INPUTS FILES [GROUPS]`.
//!
//! Columns are `x0`, `x1`, ..., uniform between -1 and 1, `y`, a smooth function of them with noise, and with
//! groups `sensor`, whose value shifts that function.

use std::error::Error;
use std::fs::{self, File};
use std::path::Path;
use std::sync::Arc;

use datafusion::arrow::array::{ArrayRef, Float64Array, Int64Array, RecordBatch};
use parquet::arrow::ArrowWriter;

/// The finalizer of SplitMix64, from a counter to a number between -1 and 1.
fn uniform(counter: &mut u64) -> f64 {
    *counter = counter.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let value = (*counter ^ (*counter >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (value ^ (value >> 31)) as f64 / 2_f64.powi(63) - 1.0
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, numbers @ ..] = arguments.as_slice() else {
        return Err("expected: make_rows FOLDER ROWS INPUTS FILES [GROUPS]".into());
    };
    let numbers: Result<Vec<usize>, _> = numbers.iter().map(|number| number.parse()).collect();
    let (rows, inputs, files, groups) = match *numbers?.as_slice() {
        [rows, inputs, files] => (rows, inputs, files.max(1), 0),
        [rows, inputs, files, groups] => (rows, inputs, files.max(1), groups),
        _ => return Err("expected: make_rows FOLDER ROWS INPUTS FILES [GROUPS]".into()),
    };
    fs::create_dir_all(folder)?;
    let mut counter = 1;
    for file in 0..files {
        let count = rows * (file + 1) / files - rows * file / files;
        let mut columns = vec![Vec::with_capacity(count); inputs];
        let (mut y, mut sensors) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for row in 0..count {
            let sensor = (row * files + file) % groups.max(1);
            let mut sum = (sensor as f64).sin();
            for (number, column) in columns.iter_mut().enumerate() {
                let value = uniform(&mut counter);
                sum += (value * (1.0 + number as f64 * 0.1)).sin() / (1.0 + number as f64);
                column.push(value);
            }
            y.push(sum.tanh() + 0.05 * uniform(&mut counter));
            sensors.push(sensor as i64);
        }
        let mut batch: Vec<(String, ArrayRef)> = Vec::new();
        if groups > 0 {
            batch.push(("sensor".to_owned(), Arc::new(Int64Array::from(sensors))));
        }
        for (number, column) in columns.into_iter().enumerate() {
            batch.push((format!("x{number}"), Arc::new(Float64Array::from(column))));
        }
        batch.push(("y".to_owned(), Arc::new(Float64Array::from(y))));
        let batch = RecordBatch::try_from_iter(batch)?;
        let path = Path::new(folder).join(format!("rows-{file}.parquet"));
        let mut writer = ArrowWriter::try_new(File::create(path)?, batch.schema(), None)?;
        writer.write(&batch)?;
        writer.close()?;
    }
    Ok(())
}
