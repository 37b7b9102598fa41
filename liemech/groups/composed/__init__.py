"""Groups put together from others: products, powers, semidirect products, species."""
