//! Values on their way: captured, and not to be read yet.

use crate::schedule::Phases;

/// Values that arrive a fixed number of steps after their capture, in a queue per environment. All memory is taken at
/// construction.
#[derive(Clone, Debug)]
pub(crate) struct DelayLine<T> {
    steps: u64,
    /// Slots per environment.
    capacity: usize,
    queues: Vec<Queue>,
    /// Values and the steps of their capture: the slots of one environment after those of the other.
    slots: Vec<(u64, T)>,
    /// Steps at which environments were last refreshed.
    refreshed: Vec<u64>,
}

/// A ring in the slots of one environment.
#[derive(Clone, Copy, Debug, Default)]
struct Queue {
    first: usize,
    len: usize,
}

/// How many values an environment has on their way at most: with one captured every `period` steps, those of the last `steps`
/// and the newest.
pub(crate) fn capacity(steps: u64, period: u64) -> usize {
    usize::try_from(steps.div_ceil(period)).map_or(usize::MAX, |n| n.saturating_add(1))
}

impl<T: Clone> DelayLine<T> {
    /// Queues of values that are captured every `period` steps at most and arrive `steps` later; slots hold `value` first.
    pub(crate) fn new(num_envs: usize, steps: u64, period: u64, value: T) -> Self {
        let capacity = capacity(steps, period);
        let slots = vec![(0, value); num_envs * capacity];
        Self { steps, capacity, queues: vec![Queue::default(); num_envs], slots, refreshed: vec![0; num_envs] }
    }

    /// Sends a value of environment `env` on its way at `step`: it is to be written over what this slot held before.
    pub(crate) fn push(&mut self, env: usize, step: u64) -> &mut T {
        let queue = &mut self.queues[env];
        if queue.len == self.capacity {
            // Nothing was taken for a long time: the oldest value would have been overtaken anyway.
            *queue = Queue { first: (queue.first + 1) % self.capacity, len: queue.len - 1 };
        }
        let slot = env * self.capacity + (queue.first + queue.len) % self.capacity;
        queue.len += 1;
        let (captured, value) = &mut self.slots[slot];
        *captured = step;
        value
    }

    /// Takes the oldest value of environment `env` that has arrived by `step`, and true where it was captured after the last
    /// [`refresh`](Self::refresh).
    pub(crate) fn take(&mut self, env: usize, step: u64) -> Option<(&T, bool)> {
        self.arrival(env).filter(|&arrival| arrival <= step)?;
        let queue = &mut self.queues[env];
        let slot = env * self.capacity + queue.first;
        *queue = Queue { first: (queue.first + 1) % self.capacity, len: queue.len - 1 };
        let (captured, value) = &self.slots[slot];
        Some((value, *captured > self.refreshed[env]))
    }

    /// The step at which the next value of environment `env` arrives.
    fn arrival(&self, env: usize) -> Option<u64> {
        let queue = self.queues[env];
        (queue.len > 0).then(|| self.slots[env * self.capacity + queue.first].0 + self.steps)
    }

    /// Steps until the next arrival in any environment, at least 1, when they are at `steps`; `None` where nothing is on its
    /// way.
    pub(crate) fn due_in(&self, steps: impl IntoIterator<Item = u64>) -> Option<u64> {
        let running = steps.into_iter().enumerate().filter(|(_, now)| *now != Phases::STANDS);
        running.filter_map(|(env, now)| Some(self.arrival(env)?.saturating_sub(now).max(1))).min()
    }

    /// Notes that the current value of environment `env` was read anew at `step`: values that were captured before are not to
    /// replace it when they arrive.
    pub(crate) fn refresh(&mut self, env: usize, step: u64) {
        self.refreshed[env] = step;
    }

    /// Forgets what is on its way in environment `env`.
    pub(crate) fn clear(&mut self, env: usize) {
        self.queues[env] = Queue::default();
    }
}
