//! Exports say what the model says: C compiled and run, GLSL in WebGL2 and WGSL in WebGPU of a
//! headless browser, HLSL by way of SPIR-V and WGSL, MERL tables by this project's own reader.
//!
//! Tests that need a compiler or a browser are ignored unless asked for (`cargo xtask test
//! --browser`). Shaders are at least parsed and validated everywhere.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::browser::shader_values;
use crate::exports::{check, directions, models, network, samples};
use elm::{Activation, ElmParams};
use elm_brdf::export::{ExportError, Format, Language, merl, source};
use elm_brdf::features::Features;
use elm_brdf::fit::Fit;
use elm_brdf::model::{BrdfModel, BrdfParams};
use elm_brdf::target_transform::TargetTransform;
use elm_datasets::Brdf;
use elm_datasets::brdf::EvalError;
use elm_datasets::geometry::DirectionPair;
use elm_datasets::merl::{Merl, cell};
use elm_test_support::{chromium, program};
use ndarray::ArrayViewMut2;

/// The sources of all models in a language.
fn sources(language: Language) -> Vec<(String, Box<dyn Brdf>, String)> {
    models()
        .into_iter()
        .map(|(name, model)| {
            let text = source(BrdfModel::of(&*model).unwrap(), language, &name).unwrap();
            (name, model, text)
        })
        .collect()
}

#[test]
#[ignore = "needs a C compiler"]
fn c_source_compiles_without_a_warning_and_agrees_with_the_model() {
    let Some(cc) = program("cc") else {
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    let models = sources(Language::C);
    let mut text = String::from("#include <stdio.h>\n");
    let mut main = String::from(
        "int main(void) {\n    float l[3], v[3], rgb[3];\n    while (scanf(\"%f %f %f %f %f %f\", l, l + 1, \
         l + 2, v, v + 1, v + 2) == 6) {\n",
    );
    for (name, _, source) in &models {
        // All in one file: their names must not collide.
        text += source;
        writeln!(
            main,
            "        {name}_eval(l, v, rgb);\n        printf(\"%.9g %.9g %.9g\\n\", (double)rgb[0], \
             (double)rgb[1], (double)rgb[2]);"
        )
        .unwrap();
    }
    text += &main;
    text += "    }\n    return 0;\n}\n";
    let (file, program) = (dir.path().join("models.c"), dir.path().join("models"));
    std::fs::write(&file, text).unwrap();
    let compiled = Command::new(cc)
        .args([
            "-std=c99",
            "-O1",
            "-Wall",
            "-Wextra",
            "-Wdouble-promotion",
            "-Wconversion",
            "-Werror",
        ])
        .args(["-pedantic", "-o"])
        .args([&program, &file])
        .arg("-lm")
        .output()
        .unwrap();
    assert!(
        compiled.status.success(),
        "{}",
        String::from_utf8_lossy(&compiled.stderr)
    );

    let pairs = directions();
    let mut run = Command::new(program)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut questions = String::new();
    for pair in &pairs {
        for c in pair.incident.iter().chain(&pair.outgoing) {
            write!(questions, "{c:e} ").unwrap();
        }
    }
    let mut stdin = run.stdin.take().unwrap();
    let feeder = std::thread::spawn(move || stdin.write_all(questions.as_bytes()));
    let output = run.wait_with_output().unwrap();
    feeder.join().unwrap().unwrap();
    let numbers: Vec<[f64; 3]> = String::from_utf8(output.stdout)
        .unwrap()
        .lines()
        .map(|line| {
            let mut numbers = line.split(' ').map(|n| n.parse().unwrap());
            [0; 3].map(|_| numbers.next().unwrap())
        })
        .collect();
    for (index, (name, model, _)) in models.iter().enumerate() {
        let found: Vec<[f64; 3]> = numbers
            .iter()
            .skip(index)
            .step_by(models.len())
            .copied()
            .collect();
        let worst = check(name, &**model, &pairs, &found);
        println!("C {name}: {worst:.1e}");
    }
}

/// Parses and validates a shader.
fn validated(module: naga::Module) -> (naga::Module, naga::valid::ModuleInfo) {
    let mut validator = naga::valid::Validator::new(
        naga::valid::ValidationFlags::all(),
        naga::valid::Capabilities::default(),
    );
    let info = validator.validate(&module).unwrap();
    (module, info)
}

#[test]
fn glsl_and_wgsl_sources_parse_and_validate() {
    let mut parser = naga::front::glsl::Frontend::default();
    let options = naga::front::glsl::Options::from(naga::ShaderStage::Fragment);
    for (name, _, text) in sources(Language::Glsl) {
        let shader = format!(
            "#version 450 core\n{text}layout(location = 0) out vec4 colour;\nvoid main() {{\n\
             colour = vec4({name}_eval(vec3(0, 0, 1), vec3(0, 0, 1)), 1.0);\n}}\n"
        );
        let module = parser.parse(&options, &shader);
        validated(module.unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(&shader))));
    }
    for (name, _, text) in sources(Language::Wgsl) {
        let module = naga::front::wgsl::parse_str(&text);
        validated(module.unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(&text))));
    }
}

#[test]
#[ignore = "needs glslangValidator"]
fn glslang_takes_glsl_of_the_web_and_of_desktops() {
    let Some(glslang) = program("glslangValidator") else {
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    for (name, _, text) in sources(Language::Glsl) {
        for version in ["300 es", "330 core"] {
            let file = dir.path().join("shader.frag");
            let shader = format!(
                "#version {version}\n{text}out vec4 colour;\nvoid main() {{\n\
                 colour = vec4({name}_eval(vec3(0, 0, 1), vec3(0, 0, 1)), 1.0);\n}}\n"
            );
            std::fs::write(&file, shader).unwrap();
            let output = Command::new(&glslang).arg(&file).output().unwrap();
            let said = String::from_utf8_lossy(&output.stdout);
            assert!(output.status.success(), "{name}, {version}: {said}");
        }
    }
}

/// HLSL as WGSL: compiled to SPIR-V by glslang, and translated from there.
fn hlsl_as_wgsl(glslang: &Path, name: &str, text: &str) -> String {
    let dir = tempfile::tempdir().unwrap();
    let (file, binary) = (
        dir.path().join("shader.hlsl"),
        dir.path().join("shader.spv"),
    );
    let shader = format!(
        "{text}RWStructuredBuffer<float4> pairs : register(u0);\n\
         RWStructuredBuffer<float4> values : register(u1);\n\
         [numthreads(1, 1, 1)]\nvoid main(uint3 id : SV_DispatchThreadID) {{\n\
         values[id.x] = float4({name}_eval(pairs[2 * id.x].xyz, pairs[2 * id.x + 1].xyz), 1.0);\n}}\n"
    );
    std::fs::write(&file, shader).unwrap();
    let output = Command::new(glslang)
        .args(["-D", "-V", "-S", "comp", "-e", "main", "-o"])
        .args([&binary, &file])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{name}: {said}");
    let binary = std::fs::read(&binary).unwrap();
    let module = naga::front::spv::parse_u8_slice(&binary, &naga::front::spv::Options::default());
    let (module, info) = validated(module.unwrap());
    naga::back::wgsl::write_string(&module, &info, naga::back::wgsl::WriterFlags::empty()).unwrap()
}

#[test]
#[ignore = "needs Chromium and glslangValidator"]
fn shaders_run_in_a_browser_agree_with_the_model() {
    let (Some(chromium), Some(glslang)) = (chromium(), program("glslangValidator")) else {
        return;
    };
    let pairs = directions();
    let mut jobs = Vec::new();
    for (name, _, text) in sources(Language::Glsl) {
        jobs.push(serde_json::json!({ "language": "glsl", "name": name, "text": format!(
            "#version 300 es\n{text}uniform highp sampler2D pairs;\nout highp vec4 value;\n\
             void main() {{\nint x = int(gl_FragCoord.x);\nvalue = vec4({name}_eval(\n\
             texelFetch(pairs, ivec2(x, 0), 0).xyz, texelFetch(pairs, ivec2(x, 1), 0).xyz), 1.0);\n}}\n"
        )}));
    }
    for (name, _, text) in sources(Language::Wgsl) {
        jobs.push(serde_json::json!({ "language": "wgsl", "name": name, "text": format!(
            "{text}@group(0) @binding(0) var<storage, read_write> pairs: array<vec4<f32>>;\n\
             @group(0) @binding(1) var<storage, read_write> values: array<vec4<f32>>;\n\
             @compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3<u32>) {{\n\
             let value = {name}_eval(pairs[2u * id.x].xyz, pairs[2u * id.x + 1u].xyz);\n\
             values[id.x] = vec4<f32>(value, 1.0);\n}}\n"
        )}));
    }
    for (name, _, text) in sources(Language::Hlsl) {
        let text = hlsl_as_wgsl(&glslang, &name, &text);
        jobs.push(serde_json::json!({ "language": "hlsl", "name": name, "text": text }));
    }
    let corners: Vec<[[f64; 3]; 2]> = pairs.iter().map(|p| [p.incident, p.outgoing]).collect();
    let found = shader_values(&chromium, &jobs, &corners);
    let mut compared = 0;
    for (name, model) in models() {
        for language in ["glsl", "wgsl", "hlsl"] {
            let label = format!("{language} {name}");
            let Some((_, values)) = found.iter().find(|(found, _)| *found == label) else {
                continue;
            };
            let worst = check(&label, &*model, &pairs, values);
            println!("{label}: {worst:.1e}");
            compared += 1;
        }
    }
    assert!(compared >= models().len(), "only {compared} shaders ran");
}

/// A formula of one channel.
struct Gray;

impl Brdf for Gray {
    fn channels(&self) -> usize {
        1
    }

    fn eval_into(
        &self,
        pairs: &[DirectionPair],
        mut values: ArrayViewMut2<'_, f64>,
    ) -> Result<(), EvalError> {
        for (value, pair) in values.iter_mut().zip(pairs) {
            *value = pair.incident[2] - 0.5;
        }
        Ok(())
    }
}

#[test]
fn merl_tables_hold_the_models_values_at_the_middle_of_every_cell() {
    let dir = tempfile::tempdir().unwrap();
    for model in [models().remove(6).1, Box::new(Gray)] {
        let path = dir.path().join("model.binary");
        merl(&*model).unwrap().write(&path).unwrap();
        let table = Merl::read(&path).unwrap();
        let mut compared = 0;
        for index in (0..90 * 90 * 180).step_by(997) {
            let Some(pair) = cell(index / 180 / 90, index / 180 % 90, index % 180) else {
                continue;
            };
            let value = model.eval(&[pair, pair.swapped()]).unwrap();
            let found = table.at(&pair);
            for c in 0..3 {
                // Both are one cell.
                let of = |row: usize| value[[row, c.min(value.ncols() - 1)]].max(0.0);
                let expected = 0.5 * of(0) + 0.5 * of(1);
                // Scaled by 1500 and back.
                let error = (found[c] - expected).abs();
                assert!(error <= 1e-14 * expected, "{found:?} {value}");
            }
            compared += 1;
        }
        assert!(compared > 500, "{compared}");
    }
}

#[test]
fn what_cannot_be_exported_is_an_error_of_its_own() {
    let samples = samples(7);
    let pairs = &samples.directions;
    let model = |network: ElmParams<f64>| {
        let params = BrdfParams {
            features: Features::Cosines,
            transform: TargetTransform::default_log(),
            network,
        };
        params.fit(pairs, samples.values.view()).unwrap()
    };
    for name in ["of my own", "tanh"] {
        let function = Activation::custom(name, |z: f64| z / (1.0 + z.abs()));
        let custom = model(network(9, function));
        let error = source(&custom, Language::C, "m").unwrap_err();
        assert_eq!(
            error.to_string(),
            format!("cannot export the activation '{name}'")
        );
    }
    let huge = model(
        network(9, Activation::Sine)
            .with_scale(1e300)
            .with_standardize(false),
    );
    let error = source(&huge, Language::C, "m").unwrap_err();
    assert!(
        matches!(error, elm_brdf::Error::Export(ExportError::Single { .. })),
        "{error}"
    );
    let good = model(network(9, Activation::Sine));
    for name in ["", "1a", "a b", "_a", "a__b", "a_", "gl_a", "ä"] {
        let error = source(&good, Language::C, name).unwrap_err();
        assert!(
            matches!(error, elm_brdf::Error::Export(ExportError::Name { .. })),
            "{error}"
        );
    }
    assert!(Format::of(Path::new("a.glsl")).is_ok());
    assert!(Format::of(Path::new("a.png")).is_err());
}
