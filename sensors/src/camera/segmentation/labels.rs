//! What mask ids stand for, by instance, link and class.

use crate::camera::error::CameraError;
use crate::error::SensorError;
use crate::select::matching;
use kinetoscope_scene::pattern::{PatternError, closest};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// Something that has a mask id of its own: a link of a robot, a rigid object, a geom of the world.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Thing {
    /// What the mask channel says, from 1 on.
    pub id: i32,
    /// The robot, the object, the geom of the world.
    pub object: String,
    /// The link, where the object has several.
    pub link: Option<String>,
    /// Its semantic class, where no label gives it another.
    pub class: String,
}

impl Thing {
    /// `object/link`, or the object where it has no links.
    pub fn name(&self) -> String {
        self.link.as_ref().map_or_else(|| self.object.clone(), |link| format!("{}/{link}", self.object))
    }
}

/// What is one segment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum SegmentLevel {
    /// Each object: a robot is one. Its id is the smallest mask id of its links, so it stays when more is added.
    #[default]
    Instance,
    /// Each link and each object without links. Ids are mask ids.
    Link,
    /// Each class. Ids count from 1 in the order in which the classes first appear among mask ids.
    Semantic,
}

/// Which things belong to which class.
///
/// ```
/// use kinetoscope_sensors::camera::{SegmentLevel, Segmentation, SegmentationCfg, Thing};
///
/// let thing = |id, object: &str| Thing { id, object: object.into(), link: None, class: "object".into() };
/// let cfg = SegmentationCfg::labeled(&[("table|shelf", "furniture")]);
/// let all = Segmentation::new([thing(1, "table"), thing(2, "shelf"), thing(3, "cube")], &cfg)?;
/// assert_eq!(all.segments(SegmentLevel::Semantic)[0].name, "furniture");
/// assert_eq!(all.segment_of(SegmentLevel::Semantic, 2), 1);
/// # Ok::<(), kinetoscope_sensors::SensorError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SegmentationCfg {
    /// Patterns and classes. A pattern is a regular expression that must match the whole name of an object (`arm`, which
    /// means all its links), `object/link`, or the link alone. What none matches keeps its own class.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub labels: Vec<(String, String)>,
}

impl SegmentationCfg {
    /// Labels by pattern.
    pub fn labeled(labels: &[(&str, &str)]) -> Self {
        Self { labels: labels.iter().map(|(pattern, class)| ((*pattern).into(), (*class).into())).collect() }
    }
}

/// One segment of a level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Segment {
    /// Its number in segmented pictures, never 0.
    pub id: i32,
    /// The object, `object/link`, or the class. Two segments may have one name where two things have; ids are their own.
    pub name: String,
    /// Its class; of an object whose links have several, that of the first.
    pub class: String,
    /// The mask ids that it is made of, in order.
    pub mask_ids: Vec<i32>,
}

/// What mask ids stand for: turns pictures of the mask channel into segmented ones, and says which number means what.
#[derive(Clone, Debug)]
pub struct Segmentation {
    levels: [Level; 3],
}

/// One level.
#[derive(Clone, Debug, Default)]
pub(super) struct Level {
    segments: Vec<Segment>,
    /// Mask id and segment, by mask id.
    of_mask: Vec<(i32, i32)>,
}

impl Level {
    /// The segment that a mask id belongs to.
    pub(super) fn of(&self, mask_id: i32) -> i32 {
        if mask_id == 0 {
            return 0;
        }
        let at = self.of_mask.binary_search_by_key(&mask_id, |(mask, _)| *mask);
        at.map_or(Segmentation::UNKNOWN, |at| self.of_mask[at].1)
    }
}

impl Segmentation {
    /// The segment of mask ids that are not among the things: what was added later.
    pub const UNKNOWN: i32 = -1;

    /// Segments of some things.
    ///
    /// # Errors
    ///
    /// [`CameraError::MaskId`] for a mask id that is 0, negative or given twice, or whose class has no name; [`SensorError::Pattern`] for a pattern that is no
    /// regular expression or matches nothing (with the nearest names), and a thing that two patterns match.
    pub fn new(things: impl IntoIterator<Item = Thing>, cfg: &SegmentationCfg) -> Result<Self, SensorError> {
        let mut things: Vec<Thing> = things.into_iter().collect();
        things.sort_by_key(|thing| thing.id);
        let wrong = |id, problem| Err(CameraError::MaskId { id, problem }.into());
        if let Some(nothing) = things.iter().find(|thing| thing.id == 0) {
            return wrong(nothing.id, "means that nothing was hit");
        }
        if let Some(negative) = things.iter().find(|thing| thing.id < 0) {
            return wrong(negative.id, "is negative; ids count from 1, and -1 is what is not known");
        }
        if let Some(pair) = things.windows(2).find(|pair| pair[0].id == pair[1].id) {
            return wrong(pair[0].id, "is given twice");
        }
        label(&mut things, &cfg.labels)?;
        if let Some(nameless) = things.iter().find(|thing| thing.class.is_empty()) {
            return wrong(nameless.id, "has a class without a name");
        }
        // Links of one object are one instance. Things without links stay apart whatever they are called: a geom of the world
        // may have the name of a robot.
        let alone = |thing: &Thing| thing.link.is_none().then_some(thing.id);
        let instances = level(&things, |thing| (thing.object.clone(), alone(thing)), false);
        let links = level(&things, |thing| (thing.name(), Some(thing.id)), false);
        let classes = level(&things, |thing| (thing.class.clone(), None), true);
        Ok(Self { levels: [instances, links, classes] })
    }

    /// What there is on a level: which id means what.
    pub fn segments(&self, level: SegmentLevel) -> &[Segment] {
        &self.level(level).segments
    }

    /// The segment that a mask id belongs to: 0 for 0 (nothing was hit), [`UNKNOWN`](Self::UNKNOWN) for what is not
    /// among the things.
    pub fn segment_of(&self, level: SegmentLevel, mask_id: i32) -> i32 {
        self.level(level).of(mask_id)
    }

    pub(super) fn level(&self, level: SegmentLevel) -> &Level {
        match level {
            SegmentLevel::Instance => &self.levels[0],
            SegmentLevel::Link => &self.levels[1],
            SegmentLevel::Semantic => &self.levels[2],
        }
    }
}

/// Gives things the classes of the labels that match them.
fn label(things: &mut [Thing], labels: &[(String, String)]) -> Result<(), SensorError> {
    let names: Vec<String> = things.iter().map(Thing::name).collect();
    let objects: Vec<String> = things.iter().map(|thing| thing.object.clone()).collect();
    let mut taken_by: Vec<Option<&str>> = vec![None; things.len()];
    for (pattern, class) in labels {
        let of_objects = matching(pattern, &objects, "object");
        let of_links = matching(pattern, &names, "object or link");
        let mut found = match (of_objects, of_links) {
            (Ok(objects), Ok(links)) => [objects, links].concat(),
            (Ok(found), Err(_)) | (Err(_), Ok(found)) => found,
            (Err(_), Err(SensorError::UnknownName { what, name, .. })) => {
                let mut known: Vec<&str> = objects.iter().chain(&names).map(String::as_str).collect();
                known.extend(things.iter().filter_map(|thing| thing.link.as_deref()));
                known.sort_unstable();
                known.dedup();
                let candidates = closest(&name, known).into_iter().map(str::to_owned).collect();
                return Err(SensorError::UnknownName { what, name, candidates });
            }
            (Err(_), Err(wrong)) => return Err(wrong),
        };
        found.sort_unstable();
        found.dedup();
        for index in found {
            if let Some(first) = taken_by[index].replace(pattern) {
                let (what, name) = ("object or link", names[index].clone());
                let twice = PatternError::MatchedTwice { what, name, first: first.into(), second: pattern.clone() };
                return Err(SensorError::Pattern(twice.to_string()));
            }
            things[index].class.clone_from(class);
        }
    }
    Ok(())
}

/// Things that share a key, which begins with the name, are one segment, whose id is their first mask id, or a number from 1
/// on.
fn level(things: &[Thing], key: impl Fn(&Thing) -> (String, Option<i32>), numbered: bool) -> Level {
    let mut level = Level::default();
    let mut known: HashMap<(String, Option<i32>), usize> = HashMap::new();
    for thing in things {
        let key = key(thing);
        let name = key.0.clone();
        let segments = &mut level.segments;
        let index = *known.entry(key).or_insert(segments.len());
        if index == segments.len() {
            let id = if numbered { index as i32 + 1 } else { thing.id };
            segments.push(Segment { id, name, class: thing.class.clone(), mask_ids: Vec::new() });
        }
        segments[index].mask_ids.push(thing.id);
        level.of_mask.push((thing.id, segments[index].id));
    }
    level
}

#[cfg(test)]
mod tests {
    use super::*;

    fn thing(id: i32, object: &str, link: Option<&str>, class: &str) -> Thing {
        Thing { id, object: object.into(), link: link.map(Into::into), class: class.into() }
    }

    fn things() -> Vec<Thing> {
        vec![
            thing(1, "ground", None, "ground"),
            thing(6, "shelf", None, "object"),
            thing(2, "arm", Some("base"), "robot"),
            thing(3, "arm", Some("finger_l"), "robot"),
            thing(4, "arm", Some("finger_r"), "robot"),
            thing(5, "table", None, "object"),
            thing(7, "cube", None, "toy"),
        ]
    }

    /// Ids, names and mask ids of the classes.
    fn classes(labels: &[(&str, &str)]) -> String {
        let all = Segmentation::new(things(), &SegmentationCfg::labeled(labels)).unwrap();
        let of = |s: &Segment| format!("{} {} {:?}", s.id, s.name, s.mask_ids);
        all.segments(SegmentLevel::Semantic).iter().map(of).collect::<Vec<_>>().join(", ")
    }

    #[test]
    fn levels() {
        let all = Segmentation::new(things(), &SegmentationCfg::default()).unwrap();
        let more = things().into_iter().chain([thing(8, "lamp", None, "light")]);
        let more = Segmentation::new(more, &SegmentationCfg::default()).unwrap();
        for (level, names, segments) in [
            (SegmentLevel::Instance, "1 ground, 2 arm, 5 table, 6 shelf, 7 cube", [0, 1, 2, 2, 6, 7, -1, -1]),
            (SegmentLevel::Link, "1 ground, 2 arm/base, 3 arm/finger_l, 4 arm/finger_r", [0, 1, 2, 4, 6, 7, -1, -1]),
            (SegmentLevel::Semantic, "1 ground, 2 robot, 3 object, 4 toy", [0, 1, 2, 2, 3, 4, -1, -1]),
        ] {
            let of = |segment: &Segment| format!("{} {}", segment.id, segment.name);
            let found: Vec<String> = all.segments(level).iter().map(of).collect();
            assert_eq!(found[..names.split(", ").count()].join(", "), names);
            assert_eq!([0, 1, 2, 4, 6, 7, 8, -5].map(|id| all.segment_of(level, id)), segments);
            assert!(level == SegmentLevel::Link || found.len() == names.split(", ").count());
            // An object that is added later changes no id.
            assert_eq!(more.segments(level)[..found.len()], *all.segments(level), "{level:?}");
        }
    }

    #[test]
    fn patterns() {
        let found = classes(&[("table|shelf", "furniture"), ("finger.*", "hand")]);
        assert_eq!(found, "1 ground [1], 2 robot [2], 3 hand [3, 4], 4 furniture [5, 6], 5 toy [7]");
        // An object is all its links; a link may be named in full; classes may be those of others.
        assert_eq!(classes(&[("arm|cube", "toy"), ("ground", "object")]), "1 object [1, 5, 6], 2 toy [2, 3, 4, 7]");
        assert!(classes(&[("arm/finger_l", "left")]).contains(", 3 left [3],"));
    }

    #[test]
    fn mistakes() {
        let error = |labels: &[(&str, &str)]| {
            Segmentation::new(things(), &SegmentationCfg::labeled(labels)).unwrap_err().to_string()
        };
        let unknown = error(&[("tabel", "furniture")]);
        assert!(unknown.starts_with("there is no object or link \"tabel\"; known are \"table\""), "{unknown}");
        assert!(error(&[("fingerl", "hand")]).contains("known are \"finger_l\""));
        let both = error(&[("arm", "robot"), ("finger_.", "hand")]);
        assert!(both.contains("\"arm/finger_l\" is matched by both \"arm\" and \"finger_.\""), "{both}");
        assert!(error(&[("(", "x")]).contains("not a regular expression"));
        assert!(error(&[("(?!a)b", "x")]).contains("look-around"));
        assert_eq!(error(&[("table", "")]), "mask id 5 has a class without a name");
        let twice = vec![thing(3, "a", None, "b"), thing(3, "c", None, "b")];
        for (things, text) in [
            (vec![thing(0, "a", None, "b")], "mask id 0 means that nothing was hit"),
            (vec![thing(-1, "a", None, "b")], "mask id -1 is negative; ids count from 1, and -1 is what is not known"),
            (vec![thing(4, "a", None, "")], "mask id 4 has a class without a name"),
            (twice, "mask id 3 is given twice"),
        ] {
            assert_eq!(Segmentation::new(things, &SegmentationCfg::default()).unwrap_err().to_string(), text);
        }
    }

    #[test]
    fn equal_names() {
        let twins = [
            thing(1, "arm", None, "world"),
            thing(2, "arm", Some("base"), "robot"),
            thing(3, "arm", Some("tip"), "robot"),
            thing(4, "arm/tip", None, "object"),
            thing(5, "arm", None, "world"),
        ];
        let all = Segmentation::new(twins, &SegmentationCfg::default()).unwrap();
        let of = |level| [1, 2, 3, 4, 5].map(|id| all.segment_of(level, id));
        assert_eq!(of(SegmentLevel::Instance), [1, 2, 2, 4, 5]);
        assert_eq!(of(SegmentLevel::Link), [1, 2, 3, 4, 5]);
        assert_eq!(of(SegmentLevel::Semantic), [1, 2, 2, 3, 1]);
    }
}
