//! What of a file is left out because it stands in the file's world, and what needs it.

use super::error::RobotFileError;
use super::places::Places;
use crate::diagnostic::{Diagnostic, DiagnosticKind};
use crate::mj::Model;
use crate::mj::words::{self, PathPoint};
use crate::mjcf::part::{LeftOut, PartNames, sensors_left_out};
use std::collections::BTreeSet;

/// An index of MuJoCo's, where -1 is none.
fn some(index: i32) -> Option<usize> {
    usize::try_from(index).ok()
}

/// Says what stands in the file's world; refuses what couples the robot to it by a site or a geom.
pub(super) fn check(
    owner: &str,
    model: &Model,
    names: &PartNames,
    places: &Places,
    diagnostics: &mut Vec<Diagnostic>,
) -> Result<(), RobotFileError> {
    let in_world = |bodies: &[i32], kind: &'static str, of: &[String]| {
        let here = bodies.iter().enumerate().filter(|(_, body)| **body == 0);
        here.map(|(index, _)| format!("{kind} {:?}", of[index])).collect::<Vec<_>>()
    };
    let mut left_out = in_world(model.geom_bodyid(), "geom", &names.geoms);
    left_out.extend(in_world(model.site_bodyid(), "site", &names.sites));
    left_out.extend(in_world(model.cam_bodyid(), "camera", &names.cameras));
    left_out.extend(in_world(model.light_bodyid(), "light", &names.lights));
    if !left_out.is_empty() {
        let message = format!("{owner}: what stands in the file's world is no part of it: {}", left_out.join(", "));
        diagnostics.push(Diagnostic::new(DiagnosticKind::ElementIgnored, places.file(), message));
    }
    let needs = |element: &'static str, name: &str, needs: &str| RobotFileError::NeedsWorld {
        at: places.get(element, name),
        element,
        name: name.into(),
        needs: needs.into(),
    };
    for tendon in 0..model.ntendon() {
        let first = model.tendon_adr()[tendon] as usize;
        for point in first..first + model.tendon_num()[tendon] as usize {
            let Some(id) = some(model.wrap_objid()[point]) else { continue };
            let site = |id: usize| (model.site_bodyid()[id] == 0).then(|| &names.sites[id]);
            let used = match words::path_point(model.wrap_type()[point]) {
                Some(PathPoint::Site) => site(id),
                Some(PathPoint::Geom) => {
                    let geom = (model.geom_bodyid()[id] == 0).then(|| &names.geoms[id]);
                    geom.or_else(|| some(model.wrap_prm()[point].round() as i32).and_then(site))
                }
                _ => None,
            };
            if let Some(used) = used {
                return Err(needs("tendon", &names.tendons[tendon], used));
            }
        }
    }
    for equality in (0..model.neq()).filter(|&equality| model.equality_is_between_sites(equality)) {
        let sites = [model.eq_obj1id()[equality], model.eq_obj2id()[equality]];
        if let Some(site) = sites.into_iter().filter_map(some).find(|&site| model.site_bodyid()[site] == 0) {
            return Err(needs("equality", &names.equalities[equality], &names.sites[site]));
        }
    }
    Ok(())
}

/// Sensors that a robot cannot have: those that no part can, and those of actuators and of what stands in the file's world.
pub(super) fn sensors(model: &Model, names: &PartNames) -> Vec<(usize, LeftOut)> {
    let mut left_out = sensors_left_out(model, names);
    for sensor in 0..model.nsensor() {
        if left_out.iter().any(|(other, _)| *other == sensor) {
            continue;
        }
        let observed = [
            (model.sensor_objtype()[sensor], model.sensor_objid()[sensor]),
            (model.sensor_reftype()[sensor], model.sensor_refid()[sensor]),
        ];
        let gone = observed.into_iter().find_map(|(kind, id)| {
            let (word, id) = (words::observed(kind)?, some(id)?);
            let (name, is_gone) = match word {
                "actuator" => (&names.actuators[id], true),
                "geom" => (&names.geoms[id], model.geom_bodyid()[id] == 0),
                "site" => (&names.sites[id], model.site_bodyid()[id] == 0),
                "camera" => (&names.cameras[id], model.cam_bodyid()[id] == 0),
                _ => return None,
            };
            is_gone.then(|| format!("{word} {name:?}, which a robot leaves out"))
        });
        if let Some(what) = gone {
            left_out.push((sensor, LeftOut { element: "sensor", name: names.sensors[sensor].clone(), what }));
        }
    }
    left_out.sort_by_key(|(sensor, _)| *sensor);
    left_out
}

/// Pairs of geoms that are left out: those with what stands in the file's world, and all where the robot does not collide
/// with itself.
pub(super) fn pairs(model: &Model, self_collision: bool) -> BTreeSet<usize> {
    let of_world = |geom: i32| some(geom).is_some_and(|geom| model.geom_bodyid()[geom] == 0);
    let is_left_out =
        |pair: &usize| !self_collision || of_world(model.pair_geom1()[*pair]) || of_world(model.pair_geom2()[*pair]);
    (0..model.npair()).filter(is_left_out).collect()
}
