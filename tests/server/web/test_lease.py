"""Who may lead: laws of the lease."""

from hypothesis import given
from hypothesis import strategies as st

from server.web.lease import GIVEN_S, LEASE_S, Lease

WHO = st.sampled_from(["a", "b", "c"])
AGE = st.floats(0.0, 60.0)


@given(WHO, WHO, AGE)
def test_nobody_takes_the_lead_from_a_phone_that_speaks(holder, other, now):
    lease = Lease()
    lease.take(holder)
    assert not lease.is_free_for(other, 0.999 * LEASE_S, now)
    assert lease.is_free_for(other, LEASE_S, now)


@given(WHO, WHO, AGE)
def test_a_lead_that_was_given_is_kept_for_whom_it_was_given_to_and_not_for_ever(to, other, age):
    lease = Lease()
    lease.give(to, 100.0)
    free = lease.is_free_for(other, None, 100.0 + age)
    assert free == (other == to or age >= GIVEN_S)


@given(WHO, WHO)
def test_who_has_come_for_it_and_left_leaves_it_to_all(to, other):
    lease = Lease()
    lease.give(to, 0.0)
    lease.take(to)
    lease.free()
    assert lease.holder == ""
    assert lease.is_free_for(other, None, 1.0)


@given(WHO, WHO)
def test_who_was_shut_out_blocks_nobody(to, other):
    lease = Lease()
    lease.give(to, 0.0)
    lease.forget(to)
    assert lease.is_free_for(other, None, 1.0)


@given(WHO, WHO)
def test_who_led_last_is_remembered_when_he_has_gone(holder, other):
    lease = Lease()
    assert not lease.is_of_another(other)
    lease.take(holder)
    lease.free()
    lease.forget(holder)
    assert lease.is_of_another(other) == (other != holder)
