//! Paths from the camera through the scene, many at a time: every path waits at its surface until
//! all evaluations there are done together.

use crate::compiled_scene::{CompiledScene, Hit};
use crate::environment::LightSample;
use crate::error::Result;
use crate::light::{Light, power_heuristic};
use crate::material_cache::MaterialCache;
use crate::random::{Purpose, numbers, pixel_seed};
use crate::shading_queue::{CAPACITY, EvalRequest, SCATTERED, ShadingQueue};
use crate::shape::Ray;
use crate::stats::{Optimizations, Reason, TileStats};
use crate::vector::{BLACK, Rgb, add, largest, scaled, times};
use crate::vertex::Vertex;
use elm_datasets::geometry::DirectionPair;

/// Surfaces after which dim paths may end by chance.
const ROULETTE_FROM: u32 = 3;
/// Hashes up to here are of rays that met no surface.
const MISSED: u64 = 1;

/// Everything that the paths of a picture share.
pub(crate) struct Tracer<'a> {
    pub(crate) world: &'a CompiledScene,
    pub(crate) cache: &'a MaterialCache<'a>,
    pub(crate) savings: Optimizations,
    /// Pixels across.
    pub(crate) width: u32,
    /// Surfaces that light may meet.
    pub(crate) depth: u32,
    pub(crate) seed: u32,
    /// With one, it is taken at the pixel's centre.
    pub(crate) samples_per_pixel: u32,
    /// What a sample may lose by leaving out dim lights, in radiance.
    pub(crate) tolerance: f64,
    /// Factor on the radiance before display.
    pub(crate) gain: f64,
}

/// What a sample of a pixel found.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    pub(crate) pixel: u32,
    /// Where in the pixel, from 0 to 1 on both axes.
    pub(crate) place: [f64; 2],
    pub(crate) radiance: Rgb,
    /// The shape that was met and the lights without extent that reach it, as a hash; equal where
    /// no edge lies between.
    pub(crate) visibility_hash: u64,
    /// Whether it used randomness beyond its position in the pixel: a light point or a direction.
    pub(crate) is_stochastic: bool,
}

/// A path on its way.
struct Path {
    pixel: u32,
    place: [f64; 2],
    seed: u32,
    sample: u32,
    ray: Ray,
    hit: Hit,
    throughput: Rgb,
    radiance: Rgb,
    visibility_hash: u64,
    /// What leaving out dim lights may still cost.
    tolerance: f64,
    state: State,
}

/// Where a path goes once its direction has been evaluated.
#[derive(Clone, Copy)]
enum State {
    /// It stands at a surface.
    Arrived,
    /// It has found a light, of this radiance times the weight of having found it this way.
    FoundLight(Rgb),
    /// It goes on to another surface.
    Leaving(Ray, Hit),
    Ended,
}

impl Tracer<'_> {
    /// Takes samples of pixels, given with the range of the samples, and hands each to `sink`, in
    /// order.
    pub(crate) fn samples(
        &self,
        pixels: &[(u32, std::ops::Range<u32>)],
        batch: &mut ShadingQueue,
        tally: &mut TileStats,
        mut sink: impl FnMut(Sample),
    ) -> Result<()> {
        // As many paths at a time as keep the batch full without a large memory.
        let wave = CAPACITY / 4;
        let mut paths = Vec::with_capacity(wave);
        let all = pixels
            .iter()
            .flat_map(|(pixel, range)| range.clone().map(move |sample| (*pixel, sample)));
        let mut all = all.peekable();
        while all.peek().is_some() {
            paths.clear();
            paths.extend(
                all.by_ref()
                    .take(wave)
                    .map(|(pixel, sample)| self.start(pixel, sample)),
            );
            tally.samples += paths.len() as u64;
            tally.rays += paths.len() as u64;
            for surface in 0..self.depth {
                let mut alive = false;
                for index in 0..paths.len() {
                    if matches!(paths[index].state, State::Arrived) {
                        alive = true;
                        self.shade(index, &mut paths, surface, batch, tally)?;
                    }
                }
                self.flush(&mut paths, batch, tally)?;
                if !alive {
                    break;
                }
                for path in &mut paths {
                    path.next_bounce(surface);
                }
            }
            for path in &paths {
                sink(Sample {
                    pixel: path.pixel,
                    place: path.place,
                    radiance: path.radiance,
                    visibility_hash: path.visibility_hash,
                    is_stochastic: self.draws() && path.visibility_hash > MISSED,
                });
            }
        }
        Ok(())
    }

    /// Whether anything is drawn at a surface.
    fn draws(&self) -> bool {
        self.world.has_extended_lights || self.depth > 1
    }

    /// A path from the camera up to what it meets first.
    fn start(&self, pixel: u32, sample: u32) -> Path {
        let seed = pixel_seed(self.seed, pixel);
        let [x, y, ..] = match self.samples_per_pixel {
            1 => [0.5; 4],
            _ => numbers(seed, sample, Purpose::Pixel),
        };
        let (column, row) = (pixel % self.width, pixel / self.width);
        let ray = self
            .world
            .camera
            .ray(f64::from(column) + x, f64::from(row) + y);
        let hit = self.world.intersect(&ray);
        let (radiance, state, visibility_hash) = match hit {
            Hit::Reflector { object, .. } => {
                (BLACK, State::Arrived, u64::from(object) + MISSED + 1)
            }
            Hit::Emitter { radiance, .. } => (radiance, State::Ended, MISSED),
            Hit::Nothing => {
                let sky = self.world.environment().filter(|(_, sky)| sky.visible);
                let radiance = sky.map_or(BLACK, |(_, sky)| sky.radiance(ray.direction));
                (radiance, State::Ended, 0)
            }
        };
        Path {
            pixel,
            place: [x, y],
            seed,
            sample,
            ray,
            hit,
            throughput: [1.0; 3],
            radiance,
            visibility_hash,
            tolerance: self.tolerance,
            state,
        }
    }

    /// Asks for everything that a path needs at the surface where it stands.
    fn shade(
        &self,
        index: usize,
        paths: &mut [Path],
        surface: u32,
        batch: &mut ShadingQueue,
        tally: &mut TileStats,
    ) -> Result<()> {
        let path = &mut paths[index];
        path.state = State::Ended;
        let Hit::Reflector {
            point, material, ..
        } = path.hit
        else {
            return Ok(());
        };
        let vertex = Vertex::new(point, material, &path.ray);
        let scatters = self.world.has_extended_lights || surface + 1 < self.depth;
        for light in 0..self.world.lights.len() {
            let path = &mut paths[index];
            let request = self.next_event(light, &vertex, path, surface, scatters, tally)?;
            batch.requests.extend(request.map(|request| EvalRequest {
                path: index,
                ..request
            }));
            if batch.requests.len() >= CAPACITY {
                self.flush(paths, batch, tally)?;
            }
        }
        if scatters {
            let request = self.scatter(&vertex, &mut paths[index], surface, tally)?;
            batch.requests.extend(request.map(|request| EvalRequest {
                path: index,
                ..request
            }));
        }
        Ok(())
    }

    /// The evaluation that light number `light` needs.
    fn next_event(
        &self,
        light: usize,
        vertex: &Vertex,
        path: &mut Path,
        surface: u32,
        scatters: bool,
        tally: &mut TileStats,
    ) -> Result<Option<EvalRequest>> {
        let source = &self.world.lights[light];
        if self.savings.dim_lights && self.is_dim(source, vertex, path)? {
            tally.skip(Reason::DimLight, vertex.material, 1);
            return Ok(None);
        }
        let [a, b, ..] = if source.has_extent() {
            numbers(path.seed, path.sample, Purpose::Light(surface, light))
        } else {
            [0.0; 4]
        };
        let normal = vertex.frame.normal;
        let Some(sample) = source.sample(vertex.point.position, normal, [a, b]) else {
            return Ok(None);
        };
        let LightSample {
            direction,
            distance,
            irradiance,
            density,
        } = sample;
        let cosine = normal.dot(&direction);
        let mut reason = None;
        if vertex.is_below(direction, cosine) {
            reason = Some(Reason::BelowHorizon);
        } else {
            tally.rays += 1;
            if self.world.blocked(&vertex.ray(direction), distance) {
                reason = Some(Reason::InShadow);
            } else if density.is_none() && surface == 0 {
                path.mark(light);
            }
        }
        if let Some(reason) = reason.filter(|_| self.savings.directions) {
            tally.skip(reason, vertex.material, 1);
            return Ok(None);
        }
        let pair = vertex.pair(direction);
        let material = self.cache.get(vertex.material)?;
        let share = match density {
            Some(density) if scatters => {
                power_heuristic(density, material.pdf(pair.outgoing, pair.incident))
            }
            _ => 1.0,
        };
        let weight = scaled(times(path.throughput, irradiance), cosine * share);
        Ok(Some(EvalRequest {
            material: vertex.material,
            pair,
            path: 0,
            light,
            weight,
            counts: reason.is_none(),
        }))
    }

    /// Whether a light can be left out within what the path may still lose; if so, it has lost it.
    fn is_dim(&self, light: &Light, vertex: &Vertex, path: &mut Path) -> Result<bool> {
        let irradiance = light.most_irradiance(vertex.point.position, vertex.frame.normal);
        if irradiance[0].is_infinite() {
            return Ok(false);
        }
        let max_value = self.cache.get(vertex.material)?.max_value();
        let most = largest(times(path.throughput, times(irradiance, max_value)));
        // Nothing at all is left to the horizon test, which costs no tolerance.
        let dim = most > 0.0 && most <= path.tolerance;
        if dim {
            path.tolerance -= most;
        }
        Ok(dim)
    }

    /// Draws the direction in which a path goes on, finds what is there, and returns the
    /// evaluation that it needs.
    fn scatter(
        &self,
        vertex: &Vertex,
        path: &mut Path,
        surface: u32,
        tally: &mut TileStats,
    ) -> Result<Option<EvalRequest>> {
        let [a, b, ..] = numbers(path.seed, path.sample, Purpose::Scatter(surface));
        let material = self.cache.get(vertex.material)?;
        let (incident, density) = material.sample(vertex.outgoing, [a, b]);
        let direction = vertex.frame.world(incident);
        let mut reason = None;
        if density <= 0.0 || vertex.is_below(direction, incident[2]) {
            reason = Some(Reason::BelowHorizon);
        } else {
            tally.rays += 1;
            let ray = vertex.ray(direction);
            path.state = self.follow(ray, vertex, density, surface);
            if matches!(path.state, State::Ended) {
                reason = Some(Reason::NoLight);
            }
        }
        if let Some(reason) = reason.filter(|_| self.savings.directions) {
            tally.skip(reason, vertex.material, 1);
            return Ok(None);
        }
        let factor = if reason.is_none() {
            incident[2] / density
        } else {
            0.0
        };
        Ok(Some(EvalRequest {
            material: vertex.material,
            pair: DirectionPair {
                incident,
                outgoing: vertex.outgoing,
            },
            path: 0,
            light: SCATTERED,
            weight: [factor; 3],
            counts: reason.is_none(),
        }))
    }

    /// What becomes of a path that leaves a surface along `ray`.
    fn follow(&self, ray: Ray, vertex: &Vertex, density: f64, surface: u32) -> State {
        let found = |radiance: Rgb, light_density: f64| {
            if radiance == BLACK {
                return State::Ended;
            }
            State::FoundLight(scaled(radiance, power_heuristic(density, light_density)))
        };
        let sky = || match self.world.environment() {
            Some((_, sky)) => {
                let light_density = sky.density(vertex.frame.normal, ray.direction);
                found(sky.radiance(ray.direction), light_density)
            }
            None => State::Ended,
        };
        if surface + 1 >= self.depth && !self.world.has_area_lights {
            // Nothing but the sky counts, and what hides it need not be known.
            return match self.world.blocked(&ray, f64::INFINITY) {
                true => State::Ended,
                false => sky(),
            };
        }
        match self.world.intersect(&ray) {
            Hit::Nothing => sky(),
            Hit::Emitter {
                radiance,
                light,
                distance,
            } => match &self.world.lights[light] {
                Light::Area(area) => found(radiance, area.density(ray.direction, distance)),
                _ => State::Ended,
            },
            hit @ Hit::Reflector { .. } if surface + 1 < self.depth => State::Leaving(ray, hit),
            Hit::Reflector { .. } => State::Ended,
        }
    }

    /// Carries out all requests and gives their values to the paths.
    fn flush(
        &self,
        paths: &mut [Path],
        queue: &mut ShadingQueue,
        tally: &mut TileStats,
    ) -> Result<()> {
        queue.evaluate(self.cache, self.savings, tally)?;
        for (request, &value) in queue.requests.iter().zip(&queue.values) {
            if request.counts {
                paths[request.path].accumulate(request, value);
            }
        }
        queue.clear();
        Ok(())
    }
}

impl Path {
    /// Notes that a light without extent reaches the first surface.
    fn mark(&mut self, light: usize) {
        let bit = (light as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.visibility_hash ^= bit | 1 << 63;
    }

    fn accumulate(&mut self, request: &EvalRequest, value: Rgb) {
        let weighted = times(request.weight, value);
        if request.light == SCATTERED {
            self.throughput = times(self.throughput, weighted);
            if let State::FoundLight(radiance) = self.state {
                add(&mut self.radiance, times(self.throughput, radiance));
                self.state = State::Ended;
            }
        } else {
            add(&mut self.radiance, weighted);
        }
    }

    /// Moves on to the next surface, if there is one and the path is worth it.
    fn next_bounce(&mut self, surface: u32) {
        let State::Leaving(ray, hit) = self.state else {
            return;
        };
        self.state = State::Ended;
        let strength = largest(self.throughput);
        if surface >= ROULETTE_FROM {
            let chance = strength.min(0.95);
            let [_, _, dice, _] = numbers(self.seed, self.sample, Purpose::Scatter(surface));
            if dice >= chance {
                return;
            }
            self.throughput = scaled(self.throughput, 1.0 / chance);
        }
        if strength > 0.0 {
            (self.ray, self.hit, self.state) = (ray, hit, State::Arrived);
        }
    }
}
