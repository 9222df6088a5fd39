//! Environments keep the numbers in which their models differ. They have the bits of environments with whole copies of
//! the model.

use super::worlds::{ALL, all_properties, bits_of, cube, get, world};
use kinetoscope::mujoco::{Model, ModelEditor, ObjectKind};
use kinetoscope::prelude::*;
use kinetoscope::sim::env::SimEnv;
use kinetoscope_testkit::worlds::cfg;

/// An environment with an `mjData` of its own and this model, in the state and with the drives of `other`, which is at
/// its start.
fn twin(model: &Model, other: &SimEnv) -> SimEnv {
    let mut env = SimEnv::new(&model.with_buffers(other.data().model().buffers()), other.drives.table()).unwrap();
    env.reset(|data, _| {
        data.qpos_mut().copy_from_slice(other.data().qpos());
        data.qvel_mut().copy_from_slice(other.data().qvel());
        data.ctrl_mut().copy_from_slice(other.data().ctrl());
        data.mocap_pos_mut().copy_from_slice(other.data().mocap_pos());
        data.mocap_quat_mut().copy_from_slice(other.data().mocap_quat());
    });
    env.drives = other.drives.clone();
    env
}

/// Steps `sim` and environments with these models, and compares them.
#[track_caller]
fn compare(sim: &mut SimulationManager, models: &[Model]) {
    let mut twins: Vec<SimEnv> =
        models.iter().enumerate().map(|(i, model)| sim.batch().read(i, |env| twin(model, env))).collect();
    for block in [1, 9, 30, 60] {
        sim.update(block);
        twins.iter_mut().for_each(|env| env.step(block));
        for (i, twin) in twins.iter().enumerate() {
            let mine = sim.batch().read(i, bits_of);
            let different = mine.iter().zip(bits_of(twin)).filter(|(mine, other)| *mine != other).count();
            assert!(different == 0, "environment {i}: {different} of {} numbers", mine.len());
        }
    }
}

/// Names of geoms in properties: that of the body, or that of the geom in the world.
fn geom_name(model: &Model, geom: usize) -> Option<String> {
    match model.geom_bodyid()[geom] {
        0 => model.name(ObjectKind::Geom, geom),
        body => model.name(ObjectKind::Body, body as usize),
    }
}

#[test]
fn masses_and_friction() {
    for threads in [1, 2] {
        let mut sim = SimulationManager::new(cfg(7, threads)).unwrap();
        sim.add_robot(super::worlds::arm()).unwrap();
        for k in 0..3 {
            let at = [0.5, 0.3 * f64::from(k), 0.06];
            sim.add_rigid_object(cube(&format!("cube{k}"), 0.5, at)).unwrap();
        }
        let draw = Randomization::new().with(Property::Mass, ".*", RandomizationOp::Scale([0.8, 1.2])).with(
            Property::Friction,
            ".*",
            RandomizationOp::Set([0.3, 1.1]),
        );
        let base = sim.batch().model().clone();
        let mut editor = ModelEditor::new(&base).unwrap();
        for _ in 0..2 {
            sim.reset(None).unwrap();
            // Environment 3 keeps what it has: nothing, then the values of the first draw.
            let chosen = [0, 1, 2, 4, 5, 6].map(EnvId);
            sim.properties_mut().randomize(&draw, Some(&chosen)).unwrap();
            let whole = |env: usize| {
                editor.load(&base);
                let properties = sim.properties().of(EnvId(env)).unwrap();
                for name in properties.names(Property::Mass) {
                    let body = base.id(ObjectKind::Body, name).unwrap();
                    editor.body_mass_mut()[body] = properties.get(Property::Mass, name).unwrap()[0];
                    let moments = properties.get(Property::Inertia, name).unwrap();
                    editor.body_inertia_mut()[3 * body..3 * body + 3].copy_from_slice(moments);
                }
                let names = properties.names(Property::Friction);
                for geom in 0..base.ngeom() {
                    if let Some(name) = geom_name(&base, geom).filter(|name| names.contains(&name.as_str()))
                        && base.geom_contype()[geom] != 0
                    {
                        editor.geom_friction_mut()[3 * geom] = properties.get(Property::Friction, &name).unwrap()[0];
                    }
                }
                editor.set_constants().unwrap();
                editor.to_compiled().unwrap().into_model()
            };
            let models: Vec<Model> = (0..7).map(whole).collect();
            for (env, model) in models.iter().enumerate() {
                let mine = sim.batch().read(env, |env| env.data().model().clone());
                let arrays = |model: &Model| {
                    [
                        model.body_mass(),
                        model.body_inertia(),
                        model.body_subtreemass(),
                        model.body_invweight0(),
                        model.dof_invweight0(),
                        model.geom_friction(),
                    ]
                    .concat()
                };
                assert_eq!(arrays(&mine), arrays(model), "environment {env}");
                assert_eq!(arrays(model) == arrays(&base), env == 3 && get(&sim, 3, Property::Mass, "cube0") == [0.5]);
            }
            compare(&mut sim, &models);
            sim.properties_mut().randomize(&draw, Some(&[EnvId(3)])).unwrap();
        }
    }
}

/// All properties, with whole copies of the models that the environments have.
#[test]
fn every_property() {
    for threads in [1, 2] {
        let (mut sim, _) = world(cfg(6, threads));
        let base = sim.batch().model().clone();
        for _ in 0..2 {
            sim.properties_mut().randomize(&all_properties(), Some(&[0, 1, 3, 5].map(EnvId))).unwrap();
            let models: Vec<Model> = (0..6)
                .map(|env| {
                    let mut editor = ModelEditor::new(&base).unwrap();
                    sim.batch().read(env, |env| editor.load(env.data().model()));
                    editor.to_compiled().unwrap().into_model()
                })
                .collect();
            assert!(models[0].body_mass() != base.body_mass() && models[2].body_mass() == base.body_mass());
            compare(&mut sim, &models);
            sim.reset(None).unwrap();
        }
        // A draw whose numbers are all of a draw before leaves nothing of it.
        sim.properties_mut().reset(ALL).unwrap();
        for env in 0..6 {
            assert!(sim.batch().read(env, |env| env.data().model().unshared_arrays(&base).is_empty()));
            assert_eq!(sim.properties().bytes(EnvId(env)).unwrap(), 0);
        }
    }
}

/// Masses and friction of the bundled arm with its hand: 2 KiB for each environment.
#[test]
fn memory_of_a_draw() {
    const ENVS: usize = 32;
    let mut sim = SimulationManager::new(cfg(ENVS, 1)).unwrap();
    sim.add_robot(kinetoscope_testkit::worlds::arm_and_hand("arm")).unwrap();
    let draw = Randomization::new().with(Property::Mass, ".*", RandomizationOp::Scale([0.8, 1.2])).with(
        Property::Friction,
        ".*",
        RandomizationOp::Scale([0.5, 1.5]),
    );
    sim.properties_mut().randomize(&draw, ALL).unwrap();
    sim.properties_mut().randomize(&draw, ALL).unwrap();
    let bytes: usize = (0..ENVS).map(|env| sim.properties().bytes(EnvId(env)).unwrap()).sum();
    assert!(bytes <= ENVS * 2048 && bytes > ENVS * 500, "{} bytes", bytes / ENVS);
}
